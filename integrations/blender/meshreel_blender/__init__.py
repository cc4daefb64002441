"""Blender add-on that imports and exports `.reel` files."""

try:
    import meshreel  # noqa: F401
except ImportError as error:
    raise ImportError(
        "the Python package meshreel is missing; install the extension's zip, which brings it, or "
        "run 'pip install meshreel' with Blender's Python"
    ) from error

from . import export_operator, import_operator, panel, player, settings

bl_info = {  # for installation as a legacy add-on
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
    """Register the operators, menus, panel, object settings and handlers."""
    for module in _MODULES:
        module.register()


def unregister() -> None:
    """Unregister what `register` has registered."""
    for module in reversed(_MODULES):
        module.unregister()
