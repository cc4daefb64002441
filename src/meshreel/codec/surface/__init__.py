"""Attributes, materials and images of a surface as sections of a stream."""
