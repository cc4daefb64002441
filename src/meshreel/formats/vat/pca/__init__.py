"""PCA textures: a few fields, and a table of weights, that add up to every frame."""
