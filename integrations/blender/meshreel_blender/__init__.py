"""Blender add-on that plays `.reel` files on the timeline, and writes them."""

try:
    import meshreel  # noqa: F401
except ImportError as error:
    raise ImportError(
        "the Python package meshreel is missing; install the extension's zip, which brings it, or "
        "run 'pip install meshreel' with Blender's Python"
    ) from error

from . import export_operator, import_operator, panel, player, settings

bl_info = {  # read where this folder is installed as a legacy add-on
    "name": "Meshreel",
    "description": "Play and write compressed mesh animations (.reel)",
    "author": "The meshreel authors",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "File > Import, File > Export",
    "category": "Import-Export",
}

_MODULES = (settings, player, import_operator, export_operator, panel)


def register() -> None:
    """Add the operators, menus, panel, settings of objects and handlers."""
    for module in _MODULES:
        module.register()


def unregister() -> None:
    """Take away what `register` added."""
    for module in reversed(_MODULES):
        module.unregister()
