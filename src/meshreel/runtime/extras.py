"""Optional libraries, installed as extras of the package and imported on first use."""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

from meshreel.errors import FormatError, InvalidInputError, MeshReelError


@dataclass(frozen=True)
class Extra:
    """An optional library that some features need."""

    name: str
    """Name of the extra: ``pip install 'meshreel[name]'`` installs the library."""
    library: str
    """Name of the distribution on PyPI."""
    module: str
    """Name of the module to import."""
    error: type[MeshReelError] = FormatError
    """Raised if the library is not installed."""

    @property
    def is_installed(self) -> bool:
        """Whether the library is installed; does not import it."""
        return find_spec(self.module) is not None

    @property
    def command(self) -> str:
        """The command that installs it."""
        return install_command([self])

    def load(self, submodule: str = "") -> ModuleType:
        """Import the library, or a submodule.

        Raises
        ------
        MeshReelError
            If it is not installed; the message gives the command to install it.
        """
        try:
            return import_module(f"{self.module}.{submodule}" if submodule else self.module)
        except ImportError as error:
            raise self.error(
                f"this needs {self.library} ({error}); install it with: {self.command}"
            ) from error


def require(extras: Iterable[Extra]) -> None:
    """Import the libraries of all extras; call it before long work to fail early.

    Raises
    ------
    MeshReelError
        If libraries are not installed; the message lists all of them, and gives one command.
    """
    errors: dict[Extra, MeshReelError] = {}
    for extra in extras:
        try:
            extra.load()
        except MeshReelError as error:
            errors[extra] = error
    if not errors:
        return
    first, *others = errors
    if not others:
        raise errors[first]
    reasons = dict.fromkeys(f"{extra.library} ({errors[extra].__cause__})" for extra in errors)
    *names, last = reasons
    libraries = f"{', '.join(names)} and {last}" if names else last
    pronoun = "them" if names else "it"
    raise first.error(
        f"this needs {libraries}; install {pronoun} with: {install_command(errors)}"
    ) from errors[first]


def install_command(extras: Iterable[Extra]) -> str:
    """Return the command that installs all extras."""
    names = ",".join(dict.fromkeys(extra.name for extra in extras))
    return f"pip install 'meshreel[{names}]'"


ALEMBIC = Extra("alembic", "alembic3d", "alembic3d")
IMATH = Extra("alembic", "alembic3d", "imath")  # part of alembic3d
USD = Extra("usd", "usd-core", "pxr")
HDF = Extra("hdf", "h5py", "h5py")
VTK = Extra("vtk", "vtk", "vtkmodules")
LZ4 = Extra("vtk", "imagecodecs", "imagecodecs")  # only for VTK files that LZ4 compresses
DRACO = Extra("gltf", "DracoPy", "DracoPy")  # only for Draco-compressed files
DRACO_FRAMES = Extra("draco", "DracoPy", "DracoPy")
PNG = Extra("textures", "imagecodecs", "imagecodecs")  # 16-bit PNG
OPEN_EXR = Extra("textures", "OpenEXR", "OpenEXR")
PAPER = Extra("paper", "SciPy", "scipy", InvalidInputError)
REGISTER_SCIPY = Extra("register", "SciPy", "scipy", InvalidInputError)
REGISTER_XATLAS = Extra("register", "xatlas", "xatlas", InvalidInputError)
SURFACES = Extra("surfaces", "SciPy", "scipy", InvalidInputError)  # to compare changing faces
PEERS = Extra("peers", "SciPy", "scipy", InvalidInputError)  # to compare curves
REGISTER_PILLOW = Extra("register", "Pillow", "PIL", InvalidInputError)  # to bake textures
PLOT = Extra("plot", "matplotlib", "matplotlib", InvalidInputError)
IMAGES = Extra("images", "Pillow", "PIL", InvalidInputError)  # to re-encode images
RENDER = Extra("render", "Pillow", "PIL", InvalidInputError)
VIDEO = Extra("video", "imageio-ffmpeg", "imageio_ffmpeg")  # includes ffmpeg
VIDEO_PILLOW = Extra("video", "Pillow", "PIL", InvalidInputError)
XARRAY = Extra("xarray", "xarray", "xarray", InvalidInputError)
TORCH = Extra("torch", "PyTorch", "torch", InvalidInputError)
