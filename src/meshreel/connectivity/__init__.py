"""The face list to bytes and back, exactly, with the vertex order or without it."""
