"""Coder of the order and the first corners of faces, given the set of triangles.

Files list faces in runs of neighbours: the two halves of a quad, the quads of a row. A face that
is reached from the one before over one side (or two) is coded as a small transition; any other
starts a new run and is coded by its index in the known faces.

Corner k of known face i has the number ``3 i + k``, and so has the side that begins there; a list
of first corners therefore holds both the order of the faces and their rotations.
"""

import numpy as np
import numpy.typing as npt

from meshreel.connectivity.triangles import CORNERS, AnyFaces, twin_sides
from meshreel.connectivity.vertex_order import require_permutation
from meshreel.entropy.coder import decode_integers, encode_integers
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError

Integers = npt.NDArray[np.int64]

NARROW, WIDE = 3, 9
"""Ways to the next face: over each side; and then also over each further side of the neighbours."""

N_TRANSITIONS = 3 * WIDE  # each way, with each rotation of the face reached
TRANSITION_CENTRE = N_TRANSITIONS // 2  # makes every transition a token of its own
MAX_RUN = 256  # the decoder advances all runs at once
ABSOLUTE, DIFFERENCES = 0, 1


def encode_face_order(corners: Integers, known: AnyFaces, n_verts: int) -> bytes:
    """Bytes of the order and the first corners in which the known faces are listed.

    Parameters
    ----------
    corners : int64 array of shape (M,)
        The first corner of each listed face.
    known : integer array of shape (M, 3)
    n_verts : int
    """
    twins = twin_sides(known, n_verts)
    near = _find_transitions(corners, twins, range(NARROW))
    far = _find_transitions(corners, twins, range(NARROW, WIDE))
    wide = np.where(near < 0, far, near)
    return min((_encode_runs(corners, found) for found in (near, wide)), key=len)


def decode_face_order(data: bytes, known: AnyFaces, n_verts: int) -> Integers:
    """The first corner of each listed face, as `encode_face_order` wrote them.

    Raises
    ------
    CorruptStreamError
        If the bytes are not those of an order of these faces.
    """
    n_faces = len(known)
    lengths, position = _read_lengths(data, n_faces)
    place = _place_in_run(lengths)
    heads, odd, even = _split_by_place(place)
    if position >= len(data) or data[position] not in (ABSOLUTE, DIFFERENCES):
        raise CorruptStreamError("the order of the runs is of an unknown kind")
    sizes = [len(heads), len(heads), len(odd), len(even)]
    firsts, turns, *behind_heads = decode_integers(data[position + 1 :], sizes)
    firsts = np.cumsum(firsts) if data[position] == DIFFERENCES else firsts + n_faces // 2
    transitions = np.zeros(n_faces, np.int64)
    transitions[odd], transitions[even] = behind_heads
    transitions += TRANSITION_CENTRE
    _require_within(firsts, n_faces, "face")
    _require_within(turns, 3, "corner")
    _require_within(transitions, N_TRANSITIONS, "transition")
    corners = np.empty(n_faces, np.int64)
    corners[heads] = 3 * firsts + turns
    _walk_runs(corners, transitions, heads, lengths, twin_sides(known, n_verts))
    require_permutation(corners // 3, "face")
    return corners


def list_faces(known: AnyFaces, corners: Integers) -> Integers:
    """The known faces in the order and with the first corners given by `corners`."""
    first, turn = np.divmod(corners, 3)
    return np.asarray(known, np.int64)[first[:, None], (turn[:, None] + CORNERS) % 3]


def _reach(corners: Integers, way: Integers | int, twins: Integers) -> Integers:
    """The side at which each way out of each face arrives; any side where there is none."""
    over, further = np.divmod(np.asarray(way) - NARROW, 2)
    near = np.asarray(way) < NARROW
    arrived = twins[_turn(corners, np.where(near, way, over))]
    return np.where(near, arrived, twins[_turn(arrived, 1 + further)])


def _turn(corners: Integers, by: Integers | int) -> Integers:
    return corners // 3 * 3 + (corners + by) % 3


def _find_transitions(corners: Integers, twins: Integers, ways: range) -> Integers:
    """Transition to each face from the one before: 3 x way + turn; -1 where there is none."""
    transitions = np.full(len(corners), -1, np.int64)
    here, following = corners[:-1], corners[1:]
    for way in reversed(ways):  # the first way wins
        arrived = _reach(here, way, twins)
        found = np.flatnonzero(arrived // 3 == following // 3)
        transitions[1 + found] = 3 * way + (following - arrived)[found] % 3
    return transitions


def _encode_runs(corners: Integers, transitions: Integers) -> bytes:
    lengths = _cut_runs(np.flatnonzero(transitions < 0), len(transitions))
    heads, odd, even = _split_by_place(_place_in_run(lengths))
    firsts, turns = np.divmod(corners[heads], 3)
    centred = [transitions[places] - TRANSITION_CENTRE for places in (odd, even)]
    coded = []
    for kind, row in (
        (DIFFERENCES, np.diff(firsts, prepend=0)),
        (ABSOLUTE, firsts - len(corners) // 2),
    ):
        coded.append(bytes([kind]) + encode_integers([row, turns, *centred]))
    described = encode_integers([lengths])
    return b"".join(
        [write_varint(len(lengths)), write_varint(len(described)), described, min(coded, key=len)]
    )


def _read_lengths(data: bytes, n_faces: int) -> tuple[Integers, int]:
    n_runs, position = read_varint(data, 0)
    size, position = read_varint(data, position)
    if n_runs > n_faces or size > len(data) - position:
        raise CorruptStreamError(f"{n_runs} runs of {n_faces} faces in {size} bytes cannot be")
    (lengths,) = decode_integers(data[position : position + size], [n_runs])
    if lengths.size and (lengths.min() < 1 or lengths.max() > MAX_RUN):
        raise CorruptStreamError(f"a run has a length outside 1..{MAX_RUN}")
    if lengths.sum() != n_faces:
        raise CorruptStreamError(f"the runs have {lengths.sum()} faces; {n_faces} are announced")
    return lengths, position + size


def _cut_runs(starts: Integers, n_faces: int) -> Integers:
    """Lengths of the runs that begin at `starts`, long runs split."""
    lengths = np.diff(np.append(starts, n_faces))
    n_pieces = -(-lengths // MAX_RUN)
    pieces = np.full(n_pieces.sum(), MAX_RUN, np.int64)
    pieces[np.cumsum(n_pieces) - 1] = lengths - MAX_RUN * (n_pieces - 1)
    return pieces


def _place_in_run(lengths: Integers) -> Integers:
    return np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)


def _split_by_place(place: Integers) -> tuple[Integers, Integers, Integers]:
    """Faces that start a run, and those an odd and an even number of transitions later.

    Quads are listed as two halves, so that every second transition is of another kind.
    """
    odd = place % 2 == 1
    return np.flatnonzero(place == 0), np.flatnonzero(odd), np.flatnonzero(~odd & (place > 0))


def _walk_runs(
    corners: Integers, transitions: Integers, heads: Integers, lengths: Integers, twins: Integers
) -> None:
    """Fill in the corners after the heads, one transition of all runs at a time."""
    way, turn = np.divmod(transitions, 3)
    for place in range(1, int(lengths.max(initial=1))):
        longer = lengths > place
        heads, lengths = heads[longer], lengths[longer]
        now = heads + place
        corners[now] = _turn(_reach(corners[now - 1], way[now], twins), turn[now])


def _require_within(values: Integers, limit: int, what: str) -> None:
    if values.size and (values.min() < 0 or values.max() >= limit):
        raise CorruptStreamError(f"a {what} lies outside 0..{limit - 1}")
