"""Bases of the paper's variants: projection, graph frequencies, tracking from block to block."""
