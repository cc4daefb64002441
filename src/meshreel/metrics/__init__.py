"""Errors and bit rates of decoded sequences."""
