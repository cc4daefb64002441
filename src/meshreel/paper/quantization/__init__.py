"""Uniform quantisation of the paper's coefficients, and how bits are spread over their rows."""
