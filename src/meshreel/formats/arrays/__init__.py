"""Files of named arrays: NumPy archives and HDF5."""
