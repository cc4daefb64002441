"""Comparison of a track in our codec with array compressors, at equal largest error."""
