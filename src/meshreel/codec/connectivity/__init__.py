"""Connectivity coding: lossless coding of face lists, with or without the vertex order."""
