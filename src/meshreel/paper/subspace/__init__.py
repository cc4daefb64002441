"""Bases of the paper's variants: graph frequencies, tracking from block to block, rank."""
