"""Sections of the surface of a mesh: polygons, attributes, groups, parts, materials, images."""
