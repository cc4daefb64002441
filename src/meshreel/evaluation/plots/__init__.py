"""How diagrams look: axes, names beside lines, colors."""
