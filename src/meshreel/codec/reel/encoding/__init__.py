"""Encoder of `reel`: analysis, quantization, noise shaping, rate control.

Changes here affect size and quality, and never the meaning of stored streams.
"""
