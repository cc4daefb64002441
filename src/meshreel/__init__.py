"""meshreel compresses animated triangle meshes of fixed connectivity."""

__version__ = "0.1.0"
