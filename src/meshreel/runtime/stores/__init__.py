"""Files that are not on this machine, by their addresses; the extra [remote] brings fsspec."""
