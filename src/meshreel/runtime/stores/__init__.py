"""Remote files by address; needs fsspec, from the extra [remote]."""
