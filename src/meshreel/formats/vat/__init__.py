"""Vertex animation textures: motion as images, which shaders of game engines play."""
