"""Files of the format glTF 2.0: a scene of nodes, whose motion is baked into frames."""
