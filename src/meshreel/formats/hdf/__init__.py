"""HDF5 access shared by all HDF5-based formats, with size checks for untrusted files."""
