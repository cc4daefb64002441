"""Alembic, in which programs hand over animation that is baked into vertices."""
