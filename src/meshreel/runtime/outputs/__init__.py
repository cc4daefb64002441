"""Outputs: checked before any work, and hidden until they are complete."""
