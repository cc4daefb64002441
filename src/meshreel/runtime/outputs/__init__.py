"""Where output goes: whether it may, and where it lies until it is complete."""
