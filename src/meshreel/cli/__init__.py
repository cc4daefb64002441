"""The command line; each command is a thin file that calls the library."""

from meshreel.cli.app import main

__all__ = ["main"]
