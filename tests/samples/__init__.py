"""Meshes, files, commands and stubs shared by tests."""
