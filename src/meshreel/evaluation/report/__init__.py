"""Reports: their parts, and the files they become."""
