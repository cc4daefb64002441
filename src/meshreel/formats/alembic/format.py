"""Row of Alembic."""

from meshreel.formats.alembic.meshes import read_meshes
from meshreel.formats.alembic.write import write_alembic
from meshreel.formats.kinds import OF_SURFACES, SequenceFormat
from meshreel.runtime.extras import ALEMBIC

FORMATS = (
    SequenceFormat(
        ".abc",
        "Alembic",
        read_meshes=read_meshes,
        extra=ALEMBIC,
        reads_without_extra=True,
        write=write_alembic,
        holds_segments=True,
        holds_tracks=OF_SURFACES,
    ),
)
