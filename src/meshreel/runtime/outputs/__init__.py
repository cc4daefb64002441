"""Output files: checked before any work, and hidden until they are complete."""
