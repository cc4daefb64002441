"""Encoding of sequences to streams, and decoding, by any method."""
