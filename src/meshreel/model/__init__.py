"""Values: mesh sequences, tracks, surfaces, materials, and notes for the user."""
