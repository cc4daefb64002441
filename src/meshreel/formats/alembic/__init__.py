"""Alembic, in which programs exchange animation baked into vertices."""
