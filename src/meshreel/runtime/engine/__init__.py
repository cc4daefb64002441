"""Executors of this machine and of a Dask cluster, and calls on any executor."""
