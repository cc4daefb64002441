"""The one list of the codecs that can be measured; their modules are imported when asked for."""

from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING

from meshreel.evaluation.choices import checked_names

if TYPE_CHECKING:
    from meshreel.evaluation.codecs.peers.protocol import Peer

_PLACES = {
    "draco": ("draco", "Draco"),
    "sz3": ("error_bounded", "Sz3"),
    "zfp": ("error_bounded", "Zfp"),
    "meshopt": ("integer_deltas", "MeshOptimizer"),
    "pco": ("integer_deltas", "Pcodec"),
    "blosc2": ("lossless", "Blosc2"),
    "npz": ("lossless", "Npz"),
}
"""Module and class of each, by name."""

PEER_NAMES = tuple(_PLACES)
NONE = "none"
"""Named in place of peers where none is wanted."""


def peers_named(names: Iterable[str] = PEER_NAMES) -> "tuple[Peer, ...]":
    """The peers of these names, in the order of the list; none for "none".

    Raises
    ------
    InvalidInputError
        If a name is unknown, or there is no name.
    """
    wanted = set(names)
    if wanted == {NONE}:
        return ()
    return tuple(_peer(name) for name in checked_names(wanted, PEER_NAMES, "peer"))


def _peer(name: str) -> "Peer":
    module, kind = _PLACES[name]
    peer: Peer = getattr(import_module(f"meshreel.evaluation.codecs.peers.{module}"), kind)()
    return peer
