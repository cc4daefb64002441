"""Searches for the open questions of the paper: rows and blocks (Section V)."""
