"""A stream as the package and its core decode it, in the shape of `conformance.reader.Reel`."""

import numpy as np

from conformance.container import Container, Header
from conformance.reader import Reel
from meshreel import decode
from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import read_stream
from meshreel.codec.choices import Laplacian
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.stored_blocks import stored_block, stored_track_block
from meshreel.codec.surface.materials import (
    ALPHA_MODES,
    CHANNELS,
    FILTERS,
    MATERIAL_NUMBERS,
    TEXTURE_NUMBERS,
    WRAPS,
)  # fmt: skip
from meshreel.codec.tracks import DOMAINS, KINDS
from meshreel.entropy.exact import decode_exact
from meshreel.materials import SLOTS
from meshreel.paper.decoder import PaperBlockDecoder, stored_mesh, stored_shape
from meshreel.reel.agreed.blocks import layout_of, read_corrections, read_field_block
from meshreel.reel.agreed.items import items_of
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.reel.decoder import TrackDecoder

LETTERS = {"u1": "B", "i4": "i", "f4": "f", "f8": "d"}


def read_by_core(data):
    """A stream, decoded; as `conformance.reader.read`, so far as it is described."""
    stream = read_stream(data)
    opened, sequence = OpenStream(stream), decode(data)
    blocks, anchors = read_blocks(opened)
    is_ours = opened.method.name in ("reel", "lossless", "grid")
    starts = [one.payload for one in stream.leading if one.id is Section.START]
    promises = [one.payload for one in stream.leading if one.id is Section.PROMISE]
    numbers = [np.frombuffer(one[0], "<f8").item() if one else None for one in (starts, promises)]
    return Reel(
        container=Container(header_of(stream.header, opened.method.name), [], []),
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


def header_of(header, method):
    assert method in METHOD_NAMES
    return Header(
        n_frames=header.n_frames,
        n_verts=header.n_verts,
        n_faces=header.n_faces,
        fps=header.fps,
        vertex_type=int(header.vertex_type),
        method=method,
        laplacian=header.laplacian,
        order=header.order,
        origin=header.origin,
        scale=header.scale,
        name=header.name,
    )


def read_blocks(opened):
    """Integers of the blocks, and the anchors."""
    stored = [
        stored_block(opened.stream, opened.method, number)
        for number in range(len(opened.stream.places))
    ]
    if opened.method.name == "reel":
        graph = opened.internal_faces, opened.n_verts
        return [reel_block(graph, one) for one in stored], []
    if opened.method.name in ("lossless", "grid"):
        return [{"frames": one.n_frames, "modes": one.n_modes} for one in stored], []
    decoder = opened.blocks()
    assert isinstance(decoder, PaperBlockDecoder)
    mesh = stored_mesh(opened, decoder._variant)
    blocks = []
    for number, one in enumerate(stored):
        coded = decoder.coded(one, number)
        block = {"frames": one.n_frames, "modes": one.n_modes}
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
            shape = (one.n_frames, 3 * len(mesh.isolated))
            exact = decode_exact(one.payload(Section.EXACT), shape, opened.dtype)
            block["exact"] = [[exact.astype(exact.dtype.newbyteorder("<")).tobytes()]]
        blocks.append(block)
    return blocks, mesh.anchors.tolist()


def tracks_of(opened):
    """Of each further track what it is, its blocks, and its values."""
    found = []
    for number, header in enumerate(opened.tracks, start=1):
        decoder, items = TrackDecoder(opened, number), items_of(opened, header)
        blocks, values = [], []
        for block in range(len(opened.stream.places)):
            is_exact = header.is_exact
            shape = items.most_items, header.n_coded
            stored = stored_track_block(
                opened.stream, block, number, shape, header.dtype.itemsize, is_exact=is_exact
            )
            found_block = {"frames": stored.n_frames, "modes": 0}
            if not is_exact:
                found_block = reel_block(items.graph, stored, header.n_coded)
            blocks.append(found_block)
            values.append(decoder.block(block))
        said = {
            "name": header.name,
            "unit": header.unit,
            "kind": KINDS.index(header.kind),
            "domain": DOMAINS.index(header.domain),
            "coding": int(header.coding),
            **({"rate": header.rate} if header.coding.has_rate else {}),
            "bound": header.bound,
        }
        found.append((said, blocks, Floats(np.concatenate(values))))
    return found


def reel_block(graph, stored, n_columns=3):
    """The integers of a track in a block of `reel`."""
    layout = layout_of(stored)
    mesh = FieldMesh(graph[0], graph[1], layout.stencil_size)
    block = read_field_block(stored, layout, mesh, n_columns=n_columns)
    found = {
        "frames": stored.n_frames,
        "modes": stored.n_modes,
        "reference": layout.reference,
        "step": float(layout.step),
        "precision": 4 if layout.is_single else 8,
        "stencil": layout.stencil_size,
        "learned": layout.n_learned,
        "basis": block.basis.reshape(stored.n_modes, -1).tolist(),
        "coefficients": block.fields.tolist(),
        "correction step": 0.0,
        "corrections": {},
    }
    if layout.rests.runs:
        runs = [list(run) for run in layout.rests.runs]
        found |= {"rests": runs, "rest bits": layout.rests.bits}
    if layout.n_reused:
        found |= {"reused": layout.n_reused, "finer": float(layout.finer)}
    moves = read_corrections(stored, graph[1], n_columns)
    if moves is not None:
        at = zip(moves.frames.tolist(), moves.vertices.tolist(), strict=True)
        found["corrections"] = dict(zip(at, moves.offsets.tolist(), strict=True))
        found["correction step"] = float(moves.step)
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
