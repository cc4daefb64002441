"""The paper's evaluation on any sequences: `meshreel paper`."""
