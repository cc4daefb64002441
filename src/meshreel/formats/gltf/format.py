"""Registry entries of the glTF formats."""

from functools import partial
from pathlib import Path

from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.gltf.container import write_container, write_text
from meshreel.formats.gltf.read import list_animations, read_meshes
from meshreel.formats.gltf.rigged import write_rigged
from meshreel.formats.gltf.write import write_morphs
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import is_rigged


def write_glb(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a self-contained ``.glb`` file: a rig if the options request one, or morph targets.

    Adds the achieved errors to `stream.notes`.

    Raises
    ------
    InvalidInputError
        As `write_rigged` and `write_morphs`, or if the file is too large for its format.
    """
    if is_rigged(options):
        advice = "allow larger errors (max_error)"
        write_rigged(stream, options, partial(write_container, path, advice=advice))
    else:
        advice = "allow a larger error (max_error), or use fewer targets"
        write_morphs(stream, options, partial(write_container, path, advice=advice))


def write_gltf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a ``.gltf`` file as `write_glb` does, with a base64 buffer that is a third larger."""
    write = write_rigged if is_rigged(options) else write_morphs
    write(stream, options, partial(write_text, path))


FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        read_meshes=read_meshes,
        write=write,
        holds_segments=True,
        names_files=True,
        writes=frozenset(
            {"targets", "max_error", "normals", "compression", "meshopt", "rig", "kg", "quality"}
        ),
        holds_materials=True,
        list_animations=list_animations,
    )
    for extension, title, write in (
        (".glb", "glTF, binary", write_glb),
        (".gltf", "glTF, text", write_gltf),
    )
)
