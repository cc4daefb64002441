"""Sequences to streams and back, whatever the method."""
