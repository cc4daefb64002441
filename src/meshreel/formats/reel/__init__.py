"""Streams of our own, read and written like any other file."""
