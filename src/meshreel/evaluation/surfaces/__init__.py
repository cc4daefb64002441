"""Comparison of codecs on sequences whose faces change, by the distances between surfaces."""
