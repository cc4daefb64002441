"""PCA textures: every frame is a weighted sum of a few fields."""
