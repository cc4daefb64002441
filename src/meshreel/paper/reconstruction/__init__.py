"""Vertices from deltas: the sparse systems of the decoder and their solver."""
