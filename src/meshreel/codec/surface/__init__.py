"""Sections of the surface of a mesh: polygons, attributes, groups, hard edges, and so on."""
