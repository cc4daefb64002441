"""A stream as the package and its core decode it, in the shape of `conformance.reader.Reel`."""

import numpy as np

from conformance.container import Container, Header
from conformance.reader import Reel
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.choices import Laplacian
from meshreel.codec.decoder import decode
from meshreel.codec.entropy.exact import decode_exact
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, FILTERS, WRAPS
from meshreel.codec.surface.materials import MATERIAL_NUMBERS, TEXTURE_NUMBERS
from meshreel.kernel.files import OpenFile
from meshreel.model.materials import SLOTS
from meshreel.paper.decoder import PaperBlockDecoder, stored_mesh, stored_shape
from meshreel.paper.variants import variant_named

OF_GROUPS = ("frames", "modes", "reference", "step", "n corrections")
"""What the core says of a track in a block."""

LETTERS = {"u1": "B", "i4": "i", "f4": "f", "f8": "d"}


def read_all_by_core(data):
    """The segments of a stream, decoded; as `conformance.reader.read_all`."""
    return [read_by_core(data, number) for number in range(len(OpenFile(data, np.inf).segments))]


def read_by_core(data, segment=None):
    """A stream, or a segment, as `conformance.reader.read` decodes it, so far as the core does."""
    opened, sequence = whole_stream(data, segment=segment), decode(data, segment=segment)
    is_ours = opened.method.name in ("reel", "lossless", "grid")
    blocks, anchors = [block_of(opened, number) for number in range(opened.n_blocks)], []
    if not is_ours:
        blocks, anchors = paper_blocks(opened)
    starts, promises = (leading(opened, one) for one in (Section.START, Section.PROMISE))
    numbers = [np.frombuffer(one[0], "<f8").item() if one else None for one in (starts, promises)]
    return Reel(
        container=Container(header_of(opened), [], []),
        internal_faces=opened.internal_faces.tolist(),
        faces=sequence.faces.tolist(),
        order=opened.order.tolist(),
        blocks=blocks,
        surface=surface_of(sequence.surface),
        start=numbers[0],
        promise=numbers[1],
        anchors=anchors,
        shape=shape_of(opened),
        positions=Floats(sequence.vertices) if is_ours else None,
        tracks=tracks_of(opened),
    )


def given_by_core(said):
    """The part of a description that the core gives: values, but not the integers behind them."""
    if "segments" in said:
        return {"segments": list(map(given_by_core, said["segments"]))}
    if "hash of positions" not in said:
        return said
    tracks = [
        {name: one for name, one in track.items() if name != "rate"} | of_groups(track)
        for track in said.get("tracks", [])
    ]
    return said | of_groups(said) | ({"tracks": tracks} if tracks else {})


def of_groups(said):
    """The blocks of a description with what the core says of them."""
    kept = [{name: one[name] for name in OF_GROUPS if name in one} for one in said["blocks"]]
    return {"blocks": kept}


def shape_of(opened):
    """Steps and integers of the shape that cotangent weights are measured in."""
    if opened.laplacian is not Laplacian.COTANGENT:
        return None
    shape = stored_shape(opened)
    return shape.steps.tolist(), shape.integers.reshape(3, -1).tolist()


class Floats:
    """Floats with the method that the description asks for."""

    def __init__(self, numbers):
        self.numbers = numbers

    def tobytes(self):
        return np.ascontiguousarray(self.numbers).tobytes()

    def byteswap(self):
        self.numbers = self.numbers.byteswap()

    def __getitem__(self, place):
        return Floats(self.numbers)


def leading(opened, section):
    """Payloads of the leading sections of an id."""
    return [opened.payload(one) for one in opened.leading if one.id == section]


def header_of(opened):
    info, method = opened.file.info, opened.method.name
    announced = int.from_bytes(opened.file.bytes_at(10, 4), "little")
    assert method in METHOD_NAMES
    return Header(
        n_frames=announced,
        n_verts=info.n_verts,
        n_faces=info.n_triangles,
        fps=info.fps,
        vertex_type=info.number_bytes,
        method=method,
        laplacian=info.laplacian,
        order=info.order,
        origin=info.center,
        scale=info.diagonal,
        name=info.name,
    )


def block_of(opened, number, track=0):
    """What the core says of a track in a block."""
    place, group = opened.file.block(number, track), opened.file.group(number, track)
    found = {"frames": place.n_frames, "modes": group.n_modes}
    if group.n_modes:
        found |= {"reference": number - group.key_block, "step": group.step}
        found |= {"n corrections": group.n_corrections} if group.n_corrections else {}
    return found


def paper_blocks(opened):
    """Integers of the blocks of the paper's methods, and the anchors."""
    variant = variant_named(opened.method.name)
    decoder, mesh = PaperBlockDecoder(opened, variant), stored_mesh(opened, variant)
    blocks = []
    for number in range(opened.n_blocks):
        stored = opened.stored(number)
        coded = decoder.coded(stored, number)
        block = {"frames": stored.n_frames, "modes": stored.n_modes}
        anchors = coded.anchors
        parts = {
            "basis": coded.basis,
            "anchor": anchors and anchors.coefficients,
            "anchor residual": anchors and anchors.residuals,
            "coefficient": coded.coefficients,
        }
        for name, part in parts.items():
            if part is not None:
                plural = name if name == "basis" else name + "s"
                block[name + " steps"] = part.steps.tolist()
                block[plural] = part.integers.reshape(-1, part.integers.shape[-1]).tolist()
        if len(mesh.isolated):
            shape = (stored.n_frames, 3 * len(mesh.isolated))
            exact = decode_exact(stored.payload(Section.EXACT), shape, opened.dtype)
            block["exact"] = [[exact.astype(exact.dtype.newbyteorder("<")).tobytes()]]
        blocks.append(block)
    return blocks, mesh.anchors.tolist()


def tracks_of(opened):
    """Of each further track what it is, its blocks, and its values."""
    found = []
    for number, track in enumerate(opened.tracks, start=1):
        blocks = [block_of(opened, block, number) for block in range(opened.n_blocks)]
        values = np.empty((opened.n_frames, track.n_items, track.n_columns), track.dtype)
        opened.method.frames(opened, None).fill(values, 0, number)
        said = {name: getattr(track, name) for name in ("name", "unit", "kind", "domain", "coding")}
        found.append((said | {"bound": track.bound}, blocks, Floats(values)))
    return found


def surface_of(surface):
    """Plain values of a surface."""
    sizes = surface.face_sizes
    return {
        "polygons": None if sizes is None else sizes.tolist(),
        "attributes": [attribute_of(one) for one in surface.attributes],
        "groups": [
            {"name": one.name, "labels": list(one.labels), "numbers": one.numbers.tolist()}
            for one in surface.groups
        ],
        "parts": [[one.name, one.n_verts, one.n_faces] for one in surface.parts],
        "materials": [material_of(one) for one in surface.materials],
        "images": [
            {"name": one.name, "type": one.mime_type, "data": one.data} for one in surface.images
        ],
        "hard edges": [] if surface.hard_edges is None else surface.hard_edges.tolist(),
    }


def attribute_of(one):
    values = one.values.astype(one.values.dtype.newbyteorder("<"))
    return {
        "name": one.name,
        "kind": str(one.kind),
        "domain": str(one.domain),
        "type": LETTERS[one.values.dtype.str[1:]],
        "width": values.shape[1],
        "values": [[row.tobytes()] for row in values],
        "rows": None if one.indices is None else one.indices.tolist(),
    }


def numbers_of(one, sizes):
    found = [getattr(one, name) for name in sizes]
    return [number for each in found for number in (each if isinstance(each, tuple) else [each])]


def material_of(one):
    assert ALPHA_MODES[0] == "opaque"
    return {
        "name": one.name,
        "alpha mode": str(one.alpha_mode),
        "numbers": numbers_of(one, MATERIAL_NUMBERS),
        "double sided": one.double_sided,
        "unlit": one.unlit,
        "textures": {
            slot: texture_of(one.textures[slot]) for slot in SLOTS if slot in one.textures
        },
    }


def texture_of(one):
    filters = [
        0 if each is None else 1 + FILTERS.index(each) for each in (one.magnified, one.shrunk)
    ]
    return {
        "image": one.image,
        "uv": one.uv,
        "wrap": [WRAPS.index(one.wrap_u), WRAPS.index(one.wrap_v)],
        "channels": "".join(letter for letter in CHANNELS if letter in one.channels),
        "filters": filters,
        "numbers": numbers_of(one, TEXTURE_NUMBERS),
    }
