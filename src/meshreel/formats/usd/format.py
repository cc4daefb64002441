"""Rows of USD."""

from meshreel.formats.kinds import OF_SURFACES, SequenceFormat
from meshreel.formats.usd.reading import read_meshes
from meshreel.formats.usd.rigged import write_any_usd
from meshreel.runtime.extras import USD

TITLES = {
    ".usd": "USD",
    ".usda": "USD, text",
    ".usdc": "USD, binary",
    ".usdz": "USD, package",
}

FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        read_meshes=read_meshes,
        extra=USD,
        write=write_any_usd,
        holds_segments=True,
        writes=frozenset({"rig", "kg", "quality", "max_error"}),
        names_files=True,
        holds_materials=True,
        has_image_folder=extension != ".usdz",
        holds_tracks=OF_SURFACES,
    )
    for extension, title in TITLES.items()
)
