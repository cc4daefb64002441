"""Row of vertex animation textures."""

from meshreel.formats.kinds import FolderFormat
from meshreel.formats.vat.folder import vat_files, write_vat
from meshreel.runtime.extras import OPEN_EXR

FORMATS = (
    FolderFormat(
        ".vat",
        "vertex animation textures",
        vat_files,
        write_vat,
        extra=OPEN_EXR,
        writes=frozenset({"layout", "textures", "max_error", "normals"}),
    ),
)
