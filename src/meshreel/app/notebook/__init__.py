"""Display of sequences and files in a notebook or the browser."""
