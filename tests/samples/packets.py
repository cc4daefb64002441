"""Packets of the player read back, as its page reads them."""

import base64
import json
import re
import zlib
from io import BytesIO

import numpy as np

from meshreel.codec.decoder import decode
from meshreel.codec.reel_file import ReelFile
from meshreel.viewer.block_packets import block_packet


def read_packet(data):
    """Header and arrays of a packet."""
    size = int.from_bytes(data[:4], "little")
    header, behind = json.loads(data[4 : 4 + size]), data[4 + size :]
    assert (4 + size) % 8 == 0
    arrays = {}
    for entry in header["arrays"]:
        assert entry["offset"] % 8 == 0
        kind, count = np.dtype(entry["type"]).newbyteorder("<"), int(np.prod(entry["shape"]))
        array = np.frombuffer(behind, kind, count, entry["offset"])
        arrays[entry["name"]] = array.reshape(entry["shape"])
    return header, arrays


def played(data, n_modes=None):
    """Positions of all frames of a block packet, of shape (T_b, V, 3), about the origin."""
    _, arrays = read_packet(data)
    fields = arrays["fields"] * arrays["field_scales"][:, None]
    weights = arrays["weights"]
    if n_modes is not None:  # the others rest
        weights = weights.copy()
        weights[:, n_modes:] = weights[:, n_modes:].mean(axis=0)
    positions = np.einsum("kv,tka->tva", fields, weights).astype(np.float32)
    if n_modes is None:
        starts = arrays["correction_starts"]
        for frame in range(len(positions)):
            of_frame = slice(starts[frame], starts[frame + 1])
            positions[frame, arrays["correction_vertices"][of_frame]] += arrays[
                "correction_values"
            ][of_frame]
    return positions


def all_played(data, allowed_error=0.0):
    """Positions of all frames of a stream in model units, and the packets of its blocks."""
    with ReelFile(BytesIO(data)) as reel:
        packets = [
            block_packet(reel.block(number), allowed_error)
            for number in range(len(reel.starts) - 1)
        ]
        return np.concatenate(list(map(played, packets))) + np.array(reel.frame.origin), packets


def largest_error(data, allowed_error=0.0):
    """How far the vertices that are drawn are from those that are decoded, in diagonals."""
    decoded = decode(data)
    drawn = np.unique(decoded.faces)
    found, _ = all_played(data, allowed_error)
    diagonal = np.linalg.norm(np.ptp(decoded.vertices.astype(float), axis=(0, 1)))
    return np.linalg.norm(found - decoded.vertices, axis=2)[:, drawn].max() / diagonal


def inlined(html):
    """What an exported page carries: answers by path, packets inflated."""
    (script,) = re.findall(r"<script>window\.MESHREEL=(.*?)</script>", html, re.S)
    return {
        path: zlib.decompress(base64.b64decode(answer), -15) if isinstance(answer, str) else answer
        for path, answer in json.loads(script).items()
    }
