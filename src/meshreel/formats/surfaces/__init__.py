"""Polygons, welding, hard edges and images, shared by readers and writers."""
