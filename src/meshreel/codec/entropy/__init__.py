"""Entropy coding: integers to bytes and back, with the same bytes on every machine."""
