"""Registration: raw frames, each with its own mesh, become segments of constant connectivity."""
