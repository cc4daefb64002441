"""Reconstruction of vertices from deltas: the sparse systems of the decoder and their solver."""
