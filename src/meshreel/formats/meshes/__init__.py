"""Files that hold one mesh, so one frame of a sequence: OBJ, OFF, PLY and STL."""
