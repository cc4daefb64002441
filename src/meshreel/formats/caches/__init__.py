"""Point caches, which store positions without faces: PC2 and MDD."""
