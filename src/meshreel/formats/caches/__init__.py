"""Point caches, which hold positions and no faces: PC2 and MDD."""
