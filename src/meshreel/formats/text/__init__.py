"""Words and numbers in text files."""
