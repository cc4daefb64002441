"""Geometry and topology of one mesh: edges, components, Laplacians, normals, polygons."""
