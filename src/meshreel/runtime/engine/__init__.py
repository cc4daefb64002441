"""Independent calls on processes of this machine or on a Dask cluster, behind one interface."""
