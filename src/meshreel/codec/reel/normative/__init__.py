"""The mathematics that encoder and decoder of `reel` agree on.

Whatever changes here changes what stored streams mean: hierarchy, stencils, predictor weights,
levels, timeline, corrections, and how all of it lies in a stream. Both sides call it, so that the
encoder knows exactly what the decoder will know.
"""
