"""Sequences and files shown in a notebook, or in the browser."""
