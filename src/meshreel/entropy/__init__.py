"""Integers to bytes and back, exactly, on every machine."""
