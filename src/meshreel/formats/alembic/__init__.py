"""Alembic, in which programs hand over animation that is baked into vertices."""

from meshreel.formats.alembic.meshes import read_meshes
from meshreel.formats.alembic.write import write_alembic
from meshreel.formats.scene_source import scene_opener

open_alembic = scene_opener(read_meshes)

__all__ = ["open_alembic", "write_alembic"]
