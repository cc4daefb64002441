"""Meshes of files that hold several, each chosen, merged with the others, or taken apart again."""
