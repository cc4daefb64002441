"""Rows of glTF."""

from meshreel.formats.gltf.read import list_animations, read_meshes
from meshreel.formats.gltf.rigged import write_any_glb, write_any_gltf
from meshreel.formats.kinds import SequenceFormat

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
        (".glb", "glTF, binary", write_any_glb),
        (".gltf", "glTF, text", write_any_gltf),
    )
)
