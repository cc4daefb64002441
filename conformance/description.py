"""Descriptions of decoded streams: counts, and SHA-256 of longer data."""

import hashlib
import struct
import sys


def describe_all(reels):
    """Return the description of a stream from its segments."""
    described = [describe(reel) for reel in reels]
    return described[0] if len(described) == 1 else {"segments": described}


def describe(reel):
    """Return the description of a decoded segment, as plain values for JSON.

    Integers are hashed as little-endian int64, floats as they are stored.
    """
    header, surface = reel.container.header, reel.surface
    description = {
        "method": header.method,
        "frames": sum(block["frames"] for block in reel.blocks),
        "vertices": header.n_verts,
        "faces": header.n_faces,
        "fps": header.fps if reel.times is None else None,
        "vertex type": header.vertex_type,
        "laplacian": header.laplacian,
        "order kept": header.order,
        "origin": [x.hex() for x in header.origin],
        "scale": header.scale.hex(),
        "name": header.name,
        "start": reel.start,
        "error bound": reel.error_bound,
        **({} if reel.times is None else {"times": reel.times}),
        "hash of internal faces": hash_of(rows(reel.internal_faces)),
        "hash of faces": hash_of(rows(reel.faces)),
        "hash of order": hash_of(reel.order),
        "hash of anchors": hash_of(reel.anchors) if reel.anchors else None,
        "blocks": [describe_block(block) for block in reel.blocks],
        **describe_shape(reel.shape),
        **describe_surface(surface),
        **describe_cells(reel.cells),
    }
    if reel.positions is not None:
        description["hash of positions"] = sha(little_endian(reel.positions))
    if reel.tracks:
        description["tracks"] = [describe_track(*track) for track in reel.tracks]
    return description


def describe_track(track, blocks, values):
    """Return the fields of a further track, its blocks, and a hash of its values."""
    described = [describe_block(block) for block in blocks]
    return {**track, "blocks": described, "hash of values": sha(little_endian(values))}


def describe_block(block):
    """Return counts and hashes of the integers of a block."""
    description = {}
    for name, value in block.items():
        if isinstance(value, int) or name == "rests":
            description[name] = value
        elif name in ("step", "finer") or (name == "correction step" and value):
            description[name] = value.hex()
        elif name.endswith(" steps"):
            description["hash of " + name] = sha(struct.pack(f"<{len(value)}f", *value))
        elif name == "corrections" and value:
            ordered = sorted(value.items(), key=lambda item: item[0][::-1])
            description["n corrections"] = len(ordered)
            description["hash of corrections"] = hash_of(
                rows((*at, *offset) for at, offset in ordered)
            )
        elif name == "exact":
            description["hash of exact"] = sha(b"".join(number for row in value for number in row))
        elif name in ("basis", "anchors", "anchor residuals", "coefficients"):
            description["hash of " + name] = hash_of(rows(value))
    return description


def describe_shape(shape):
    """Return hashes of the shape of cotangent weights; empty without one."""
    if shape is None:
        return {}
    steps, integers = shape
    return {
        "hash of shape steps": sha(struct.pack(f"<{len(steps)}f", *steps)),
        "hash of shape": hash_of(rows(integers)),
    }


def describe_cells(cells):
    """Return the number and the hashes of cells; empty without any."""
    if cells is None:
        return {}
    return {
        "cells": len(cells.cells),
        "hash of cell types": hash_of(cell.code for cell in cells.cells),
        "hash of cell nodes": hash_of(node for cell in cells.cells for node in cell.nodes),
    }


def describe_surface(surface):
    """Return the description of a surface."""
    sizes = surface["polygons"]
    return {
        "polygons": None if sizes is None else len(sizes),
        "hash of polygons": None if sizes is None else hash_of(sizes),
        **({} if sizes is None else {"hash of corners": hash_of(surface["triangle corners"])}),
        "attributes": [describe_attribute(one) for one in surface["attributes"]],
        "groups": [
            {
                "name": one["name"],
                "labels": one["labels"],
                "hash of numbers": hash_of(one["numbers"]),
            }
            for one in surface["groups"]
        ],
        "parts": surface["parts"],
        "materials": surface["materials"],
        "images": [
            {"name": one["name"], "type": one["type"], "hash": sha(one["data"])}
            for one in surface["images"]
        ],
        **describe_hard_edges(sorted(surface["hard edges"])),
    }


def describe_hard_edges(edges):
    """Return the number and the hash of hard edges; empty without any."""
    return {"hard edges": len(edges), "hash of hard edges": hash_of(rows(edges))} if edges else {}


def describe_attribute(one):
    """Return the description of an attribute; values are hashed row after row."""
    return {
        **{name: one[name] for name in ("name", "kind", "domain", "type", "width")},
        "n rows": len(one["values"]),
        "hash of values": sha(b"".join(number for row in one["values"] for number in row)),
        "hash of rows": None if one["rows"] is None else hash_of(one["rows"]),
    }


def rows(lists):
    """Return the concatenated rows."""
    return [number for row in lists for number in row]


def hash_of(integers):
    """Return the SHA-256 of integers as little-endian int64."""
    integers = list(integers)
    return sha(struct.pack(f"<{len(integers)}q", *integers))


def little_endian(numbers):
    """Return the little-endian bytes of an array of floats."""
    if sys.byteorder == "big":
        numbers = numbers[:]
        numbers.byteswap()
    return numbers.tobytes()


def sha(data):
    """Return the SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
