"""Streams of meshreel (``.reel``), read and written like other formats."""
