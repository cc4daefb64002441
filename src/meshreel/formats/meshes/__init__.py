"""Formats with one static mesh, so one frame, per file: OBJ, OFF, PLY and STL."""
