"""HDF5 files read and written with every size checked, for all formats that are HDF5."""
