"""Bindings of the C library in `core/`, for NumPy arrays."""
