"""What a mesh carries beside positions and triangles, in a stream: attributes, materials, images."""
