"""Normative part of `reel`, shared by encoder and decoder.

Changes here change the meaning of stored streams: hierarchy, stencils, predictor weights, levels,
timeline, corrections, and the layout of sections.
"""
