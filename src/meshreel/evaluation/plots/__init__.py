"""Style of diagrams: axes, labels, colors."""
