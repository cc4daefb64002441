"""The command line; each command is a thin module that calls the library."""

from meshreel.app.cli.app import main

__all__ = ["main"]
