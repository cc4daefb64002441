"""Libraries that come with an extra of the package, imported when they are first needed."""

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from meshreel.errors import FormatError


@dataclass(frozen=True)
class Extra:
    """A library that some formats need.

    Parameters
    ----------
    name : str
        Of the extra: ``pip install 'meshreel[name]'`` brings the library.
    library : str
        What it is called on the package index.
    module : str
        What it is imported as.
    """

    name: str
    library: str
    module: str

    @property
    def is_installed(self) -> bool:
        """Whether the library is there; it is not imported."""
        return find_spec(self.module) is not None

    def load(self, submodule: str = "") -> ModuleType:
        """The library, or a module of it.

        Raises
        ------
        FormatError
            If it is not installed, with the command that installs it.
        """
        try:
            return import_module(f"{self.module}.{submodule}" if submodule else self.module)
        except ImportError as error:
            raise FormatError(
                f"this needs {self.library} ({error}); "
                f"install it with: pip install 'meshreel[{self.name}]'"
            ) from error


ALEMBIC = Extra("alembic", "alembic3d", "alembic3d")
IMATH = Extra("alembic", "alembic3d", "imath")  # comes with it
USD = Extra("usd", "usd-core", "pxr")
HDF = Extra("hdf", "h5py", "h5py")
DRACO = Extra("gltf", "DracoPy", "DracoPy")  # only files that Draco compressed need it
PNG = Extra("textures", "imagecodecs", "imagecodecs")  # of 16 bits a channel
OPEN_EXR = Extra("textures", "OpenEXR", "OpenEXR")
