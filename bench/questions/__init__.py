"""Searches for the open questions of the paper: rows, blocks and anchors (Section V)."""
