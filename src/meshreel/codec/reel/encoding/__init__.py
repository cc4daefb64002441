"""The encoder's choices of `reel`: analysis, rounding, shaping, rate.

Whatever changes here changes how good a stream is, and never what stored streams mean.
"""
