"""Formats that store a sequence as named arrays: NumPy archives and HDF5."""
