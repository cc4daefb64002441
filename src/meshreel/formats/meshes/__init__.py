"""Formats that store one static mesh, a single frame, per file: OBJ, OFF, PLY and STL."""
