"""Fast tokenizing, parsing and formatting of numbers in text files."""
