"""The one list of the codecs that can be measured."""

from collections.abc import Iterable

from meshreel.evaluation.choices import checked_names
from meshreel.evaluation.codecs.peers.draco import Draco
from meshreel.evaluation.codecs.peers.error_bounded import Sz3, Zfp
from meshreel.evaluation.codecs.peers.integer_deltas import MeshOptimizer, Pcodec
from meshreel.evaluation.codecs.peers.lossless import Blosc2, Npz
from meshreel.evaluation.codecs.peers.protocol import Peer

PEERS: tuple[Peer, ...] = (
    Draco(),
    Sz3(),
    Zfp(),
    MeshOptimizer(),
    Pcodec(),
    Blosc2(),
    Npz(),
)
PEER_NAMES = tuple(peer.name for peer in PEERS)
NONE = "none"
"""Named in place of peers where none is wanted."""


def checked_peers(names: Iterable[str]) -> tuple[Peer, ...]:
    """The peers of these names, in the order of the list; none for "none".

    Raises
    ------
    InvalidInputError
        If a name is unknown, or there is no name.
    """
    wanted = set(names)
    if wanted == {NONE}:
        return ()
    chosen = checked_names(wanted, PEER_NAMES, "peer")
    return tuple(peer for peer in PEERS if peer.name in chosen)
