"""Registry of the codecs in the comparison; their modules are imported on demand."""

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING

from meshreel.evaluation.choices import checked_names

if TYPE_CHECKING:
    from meshreel.evaluation.codecs.peers.protocol import Peer

_CLASSES = {
    "draco": ("draco", "Draco"),
    "sz3": ("error_bounded", "Sz3"),
    "zfp": ("error_bounded", "Zfp"),
    "meshopt": ("integer_deltas", "MeshOptimizer"),
    "pco": ("integer_deltas", "Pcodec"),
    "blosc2": ("lossless", "Blosc2"),
    "npz": ("lossless", "Npz"),
}
"""Module and class by name."""

PEER_NAMES = tuple(_CLASSES)
NONE = "none"
"""Selects no peers."""


def peers_named(names: Iterable[str] = PEER_NAMES) -> "tuple[Peer, ...]":
    """Return the peers of these names in registry order; none for "none".

    Raises
    ------
    InvalidInputError
        If a name is unknown, or `names` is empty.
    """
    selected = set(names)
    if selected == {NONE}:
        return ()
    return tuple(_peer(name) for name in checked_names(selected, PEER_NAMES, "peer"))


def _peer(name: str) -> "Peer":
    module, kind = _CLASSES[name]
    peer: Peer = getattr(import_module(f"meshreel.evaluation.codecs.peers.{module}"), kind)()
    return peer
