"""What users do: open any input, prepare it, write outputs, and return results."""
