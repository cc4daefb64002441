"""A codec of the user: two Python functions, compared like the other codecs."""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterable
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.evaluation.peers import Peer, Shape
from meshreel.model.sequence import Faces, MeshSequence, Vertices

USAGE = (
    "write --codec MODULE:ENCODE,DECODE, such as my_codec:encode,decode or my_codec.py:pack,unpack"
)
"""How to name a codec."""


def own_codec(text: str, names: Iterable[str]) -> Peer:
    """Import a codec of the user.

    The module has ``encode(vertices, faces, setting) -> bytes``, ``decode(data, faces) -> array of
    shape (T, V, 3)`` and ``SETTINGS``, the numbers for which `encode` is called. Vertices are in
    the order of the faces. The bytes of our coded connectivity are added, unless the module has
    ``HAS_FACES = True``; `decode` then receives None instead of the faces.

    Parameters
    ----------
    text : str
        "module:encode,decode"; the module is imported from the current folder or the path, or is a
        file that ends in ".py".
    names : iterable of str
        Names of other codecs, which the module must not have.

    Raises
    ------
    InvalidInputError
        If the text has another form, the module cannot be imported, or lacks one of the names.
    """
    place, colon, functions = text.rpartition(":")
    encode_name, comma, decode_name = functions.partition(",")
    if not (place and colon and comma and encode_name and decode_name):
        raise InvalidInputError(
            f"--codec {text!r} is not of the form module:encode,decode; {USAGE}"
        )
    module = _imported(place)
    name = Path(place).stem if place.endswith(".py") else place.rpartition(".")[2]
    if name in names:
        raise InvalidInputError(
            f"the codec {name!r} has the name of another one; rename its module"
        )
    encode, decode = (_function(module, each) for each in (encode_name, decode_name))
    settings = getattr(module, "SETTINGS", None)
    if settings is None or not len(settings):
        raise InvalidInputError(
            f"module {place} has no SETTINGS; add the numbers to call {encode_name} with, such as "
            "SETTINGS = (8, 10, 12)"
        )
    has_faces = bool(getattr(module, "HAS_FACES", False))

    def packed(sequence: MeshSequence, setting: float) -> bytes:
        data = encode(sequence.vertices, sequence.faces, setting)
        if not isinstance(data, bytes | bytearray | memoryview):
            raise InvalidInputError(f"{encode_name} must return bytes; got {type(data).__name__}")
        return bytes(data)

    def unpacked(data: bytes, shape: Shape, dtype: npt.DTypeLike, faces: Faces) -> Vertices:
        vertices = np.asarray(decode(data, None if has_faces else faces))
        if vertices.shape != shape:
            raise InvalidInputError(
                f"{decode_name} must return an array of shape {shape}; got {vertices.shape}"
            )
        return vertices.astype(dtype)

    numbers = tuple(settings)
    # Results of an earlier version of the module are not reused.
    digest = hashlib.sha256(inspect.getsource(module).encode()).hexdigest()[:12]
    return Peer(
        name=name,
        summary=f"the functions {encode_name} and {decode_name} of {Path(place).name}",
        package=None,
        encode=packed,
        decode=unpacked,
        settings=numbers,
        quick=numbers[:: max(1, len(numbers) // 2)],
        params="setting {:g}",
        has_faces=has_faces,
        takes_faces=True,
        source=digest,
    )


def _imported(place: str) -> ModuleType:
    try:
        if place.endswith(".py"):
            spec = spec_from_file_location(Path(place).stem, place)
            assert spec is not None
            assert spec.loader is not None
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
            return module
        sys.path.insert(0, str(Path.cwd()))
        try:
            return import_module(place)
        finally:
            sys.path.pop(0)
    except Exception as error:
        raise InvalidInputError(
            f"module {place} of --codec cannot be imported: {type(error).__name__}: {error}"
        ) from error


def _function(module: ModuleType, name: str) -> Callable[..., Any]:
    function = getattr(module, name, None)
    if not callable(function):
        raise InvalidInputError(f"module {module.__name__} has no function {name!r}; {USAGE}")
    return function  # type: ignore[no-any-return]  # what it returns is checked
