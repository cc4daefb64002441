"""Independent calls on the processes of this machine or on a Dask cluster: one interface."""
