"""Files of other programs to a `MeshSequence` and back."""
