"""Surface of a mesh: polygons, attributes, groups, parts, hard edges, materials, images."""
