"""Comparison of our codec with others: `meshreel evaluate`."""
