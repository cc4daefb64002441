"""What a stream holds, in a few lines: counts, and SHA-256 of everything long."""

import hashlib
import struct
import sys


def describe_all(reels):
    """The description of a stream, by its segments."""
    described = [describe(reel) for reel in reels]
    return described[0] if len(described) == 1 else {"segments": described}


def describe(reel):
    """The description of what `conformance.reader.read` gives, as plain values for JSON.

    Integers are hashed as little-endian int64, floats as they are stored.
    """
    header, surface = reel.container.header, reel.surface
    found = {
        "method": header.method,
        "frames": sum(block["frames"] for block in reel.blocks),
        "vertices": header.n_verts,
        "faces": header.n_faces,
        "fps": header.fps,
        "vertex type": header.vertex_type,
        "laplacian": header.laplacian,
        "order kept": header.order,
        "origin": [one.hex() for one in header.origin],
        "scale": header.scale.hex(),
        "name": header.name,
        "start": reel.start,
        "promise": reel.promise,
        "hash of internal faces": hash_of(rows(reel.internal_faces)),
        "hash of faces": hash_of(rows(reel.faces)),
        "hash of order": hash_of(reel.order),
        "hash of anchors": hash_of(reel.anchors) if reel.anchors else None,
        "blocks": [describe_block(block) for block in reel.blocks],
        **describe_shape(reel.shape),
        **describe_surface(surface),
    }
    if reel.positions is not None:
        found["hash of positions"] = sha(little_endian(reel.positions))
    if reel.tracks:
        found["tracks"] = [describe_track(*track) for track in reel.tracks]
    return found


def describe_track(said, blocks, values):
    """What a further track is, its blocks, and a hash of its values."""
    described = [describe_block(block) for block in blocks]
    return {**said, "blocks": described, "hash of values": sha(little_endian(values))}


def describe_block(block):
    """Counts and hashes of the integers of a block."""
    found = {}
    for name, value in block.items():
        if isinstance(value, int) or name == "rests":
            found[name] = value
        elif name in ("step", "finer") or (name == "correction step" and value):
            found[name] = value.hex()
        elif name.endswith(" steps"):
            found["hash of " + name] = sha(struct.pack(f"<{len(value)}f", *value))
        elif name == "corrections" and value:
            ordered = sorted(value.items(), key=lambda one: one[0][::-1])
            found["n corrections"] = len(ordered)
            found["hash of corrections"] = hash_of(rows((*at, *by) for at, by in ordered))
        elif name == "exact":
            found["hash of exact"] = sha(b"".join(number for row in value for number in row))
        elif name in ("basis", "anchors", "anchor residuals", "coefficients"):
            found["hash of " + name] = hash_of(rows(value))
    return found


def describe_shape(shape):
    """Hashes of the shape that cotangent weights are measured in; empty if the stream has none."""
    if shape is None:
        return {}
    steps, integers = shape
    return {
        "hash of shape steps": sha(struct.pack(f"<{len(steps)}f", *steps)),
        "hash of shape": hash_of(rows(integers)),
    }


def describe_surface(surface):
    """Polygons, attributes, groups, parts, materials and images."""
    sizes = surface["polygons"]
    return {
        "polygons": None if sizes is None else len(sizes),
        "hash of polygons": None if sizes is None else hash_of(sizes),
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
    """Hard edges, ascending; empty if there are none."""
    return {"hard edges": len(edges), "hash of hard edges": hash_of(rows(edges))} if edges else {}


def describe_attribute(one):
    """An attribute; values are hashed row after row, as they are stored."""
    return {
        **{name: one[name] for name in ("name", "kind", "domain", "type", "width")},
        "n rows": len(one["values"]),
        "hash of values": sha(b"".join(number for row in one["values"] for number in row)),
        "hash of rows": None if one["rows"] is None else hash_of(one["rows"]),
    }


def rows(lists):
    """The numbers of all rows, one after another."""
    return [number for row in lists for number in row]


def hash_of(integers):
    """SHA-256 of integers as little-endian int64."""
    integers = list(integers)
    return sha(struct.pack(f"<{len(integers)}q", *integers))


def little_endian(numbers):
    """Bytes of an array of floats."""
    if sys.byteorder == "big":
        numbers = numbers[:]
        numbers.byteswap()
    return numbers.tobytes()


def sha(data):
    """SHA-256, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()
