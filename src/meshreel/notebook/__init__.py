"""How sequences and files show themselves: in a notebook, or in the browser."""
