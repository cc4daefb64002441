"""Registry entries of the glTF formats."""

from pathlib import Path

from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.gltf.read import list_animations, read_meshes
from meshreel.formats.gltf.rigged import write_rigged
from meshreel.formats.gltf.write import write_morphs
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import is_rigged


def write_gltf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a self-contained file: a rig if the options request one, or morph targets.

    A ``.gltf`` file is a third larger than a ``.glb`` file, since its buffer is base64. Adds the
    achieved errors to `stream.notes`.

    Raises
    ------
    InvalidInputError
        As `write_rigged` and `write_morphs`, or if the file is too large for its format.
    """
    write = write_rigged if is_rigged(options) else write_morphs
    write(path, stream, options)


FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        read_meshes=read_meshes,
        write=write_gltf,
        holds_segments=True,
        names_files=True,
        writes=frozenset(
            {"targets", "max_error", "normals", "compression", "rig", "kg", "quality"}
        ),
        holds_materials=True,
        list_animations=list_animations,
    )
    for extension, title in (
        (".glb", "glTF, binary"),
        (".gltf", "glTF, text"),
    )
)
