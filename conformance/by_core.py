"""A stream as the package and its core decode it, in the shape of `conformance.reader.Reel`."""

import numpy as np

from conformance.container import Container, Header
from conformance.reader import Reel
from meshreel import decode
from meshreel.bitstream.layout import Section
from meshreel.codec.choices import Laplacian
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, DOMAINS, FILTERS, WRAPS
from meshreel.codec.surface.materials import MATERIAL_NUMBERS, TEXTURE_NUMBERS
from meshreel.codec.tracks import KINDS, read_track
from meshreel.entropy.exact import decode_exact
from meshreel.materials import SLOTS
from meshreel.paper.decoder import PaperBlockDecoder, stored_mesh, stored_shape
from meshreel.paper.variants import variant_named
from meshreel.reel.agreed.blocks import layout_of, read_corrections, read_field_block
from meshreel.reel.agreed.items import items_of
from meshreel.reel.agreed.mesh import FieldMesh

LETTERS = {"u1": "B", "i4": "i", "f4": "f", "f8": "d"}


def read_by_core(data):
    """A stream, decoded; as `conformance.reader.read`, so far as it is described."""
    opened, sequence = whole_stream(data), decode(data)
    blocks, anchors = read_blocks(opened)
    is_ours = opened.method.name in ("reel", "lossless", "grid")
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


def stored_group(opened, number, track=0):
    """A track of a block, as it is stored."""
    place, group = opened.file.block(number, track), opened.file.group(number, track)
    sections = dict(opened.group(number, track))
    return StoredBlock(place.first_frame, place.n_frames, group.n_modes, sections)


def read_blocks(opened):
    """Integers of the blocks, and the anchors."""
    stored = [stored_group(opened, number) for number in range(opened.n_blocks)]
    if opened.method.name == "reel":
        graph = opened.internal_faces, opened.n_verts
        return [reel_block(graph, one) for one in stored], []
    if opened.method.name in ("lossless", "grid"):
        return [{"frames": one.n_frames, "modes": one.n_modes} for one in stored], []
    variant = variant_named(opened.method.name)
    decoder, mesh = PaperBlockDecoder(opened, variant), stored_mesh(opened, variant)
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
    found, headers = [], map(read_track, leading(opened, Section.TRACK))
    for number, header in enumerate(headers, start=1):
        items, blocks = items_of(opened, header), []
        for block in range(opened.n_blocks):
            stored = stored_group(opened, block, number)
            found_block = {"frames": stored.n_frames, "modes": 0}
            if not header.is_exact:
                found_block = reel_block(items.graph, stored, header.n_coded)
            blocks.append(found_block)
        track = opened.file.tracks[number]
        values = np.empty((opened.n_frames, track.n_items, track.n_columns), track.dtype)
        opened.frames().fill(values, 0, number)
        said = {
            "name": header.name,
            "unit": header.unit,
            "kind": KINDS.index(header.kind),
            "domain": DOMAINS.index(header.domain),
            "coding": int(header.coding),
            **({"rate": header.rate} if header.coding.has_rate else {}),
            "bound": header.bound,
        }
        found.append((said, blocks, Floats(values)))
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
