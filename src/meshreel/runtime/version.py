"""The version of the package, of which `meshreel.__version__` is a copy."""

__version__ = "0.1.0"
