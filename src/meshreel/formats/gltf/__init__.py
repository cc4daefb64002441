"""Files of the format glTF 2.0: a scene of nodes, whose motion is baked into frames.

Readers raise `FormatError`, which names the place, for a file that is damaged or not supported.
"""
