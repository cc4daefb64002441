"""Streams decoded by the package and its core, as `conformance.reader.Reel`."""

from itertools import pairwise

import numpy as np

from conformance.cells import Cell, Cells
from conformance.container import Container, Header
from conformance.reader import Reel
from meshreel.codec.bitstream.layout import Laplacian, Section
from meshreel.codec.decoder import decode
from meshreel.codec.method_names import METHOD_NAMES
from meshreel.codec.methods import method_named
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, FILTERS, WRAPS
from meshreel.codec.surface.payloads import MATERIAL_NUMBERS, TEXTURE_NUMBERS
from meshreel.kernel.files import OpenFile
from meshreel.kernel.polygons import triangle_corners
from meshreel.model.materials import SLOTS
from meshreel.paper.blocks import stored_block
from meshreel.paper.decoder import PaperBlockDecoder, stored_mesh, stored_shape
from meshreel.paper.exact_values import decode_exact
from meshreel.paper.variants import variant_named

GROUP_KEYS = ("frames", "modes", "reference", "step", "n corrections")
"""Keys of a block that the core reports."""

LETTERS = {"u1": "B", "i4": "i", "f4": "f", "f8": "d"}


def read_all_by_core(data):
    """Decode all segments of a stream, like `conformance.reader.read_all`."""
    return [read_by_core(data, number) for number in range(len(OpenFile(data, np.inf).segments))]


def read_by_core(data, segment=None):
    """Decode a stream or a segment, as far as the core exposes its contents."""
    opened, sequence = whole_stream(data, segment=segment), decode(data, segment=segment)
    has_tracks = opened.method in ("reel", "lossless", "grid")
    blocks, anchors = [block_of(opened, number) for number in range(opened.n_blocks)], []
    if not has_tracks:
        blocks, anchors = paper_blocks(opened)
    info = opened.file.info
    return Reel(
        container=Container(header_of(opened), [], []),
        internal_faces=opened.file.stored_mesh[0].tolist(),
        faces=sequence.faces.tolist(),
        order=opened.file.stored_mesh[1].tolist(),
        blocks=blocks,
        surface=surface_of(sequence.surface, sequence.faces),
        start=info.start_s if leading(opened, Section.START) else None,
        times=None if opened.file.times is None else opened.file.times.tolist(),
        error_bound=info.error_bound_percent if leading(opened, Section.ERROR_BOUND) else None,
        anchors=anchors,
        shape=shape_of(opened),
        positions=Floats(sequence.vertices) if has_tracks else None,
        tracks=tracks_of(opened),
        cells=cells_of(sequence.surface.cells),
    )


def cells_of(cells):
    """Return the cells of a surface as the plain reader does, as far as descriptions use them."""
    if cells is None:
        return None
    places = pairwise(cells.starts.tolist())
    nodes = (cells.nodes[start:stop].tolist() for start, stop in places)
    listed = [Cell(*pair) for pair in zip(cells.types.tolist(), nodes, strict=True)]
    return Cells(listed, [], [], [], [])


def reported_by_core(description):
    """Return the part of a description that the core reports: values, but not their integers."""
    if "segments" in description:
        return {"segments": list(map(reported_by_core, description["segments"]))}
    if "hash of positions" not in description:
        return description
    tracks = [
        {key: value for key, value in track.items() if key != "rate"} | reported_blocks(track)
        for track in description.get("tracks", [])
    ]
    return description | reported_blocks(description) | ({"tracks": tracks} if tracks else {})


def reported_blocks(description):
    """Return the blocks of a description, reduced to the keys that the core reports."""
    blocks = description["blocks"]
    return {"blocks": [{key: b[key] for key in GROUP_KEYS if key in b} for b in blocks]}


def shape_of(opened):
    """Return steps and integers of the shape of cotangent weights."""
    if opened.laplacian is not Laplacian.COTANGENT:
        return None
    shape = stored_shape(opened)
    return shape.steps.tolist(), shape.integers.reshape(3, -1).tolist()


class Floats:
    """A float array with the interface of `array.array` that descriptions use."""

    def __init__(self, numbers):
        self.numbers = numbers

    def tobytes(self):
        return np.ascontiguousarray(self.numbers).tobytes()

    def byteswap(self):
        self.numbers = self.numbers.byteswap()

    def __getitem__(self, _):
        return Floats(self.numbers)


def leading(opened, section):
    """Return the payloads of the leading sections with an id."""
    return [opened.payload(other) for other in opened.file.leading if other.id == section]


def header_of(opened):
    info, method = opened.file.info, opened.method
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
    """Return the description of a track in a block."""
    stored, group = opened.file.block(number, track), opened.file.group(number, track)
    block = {"frames": stored.n_frames, "modes": group.n_modes}
    if group.n_modes:
        block |= {"reference": number - group.key_block, "step": group.step}
        block |= {"n corrections": group.n_corrections} if group.n_corrections else {}
    return block


def paper_blocks(opened):
    """Return the integers per block of the paper's methods, and the anchors."""
    variant = variant_named(opened.method)
    decoder, mesh = PaperBlockDecoder(opened, variant), stored_mesh(opened, variant)
    blocks = []
    for number in range(opened.n_blocks):
        stored = stored_block(opened, number)
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
    """Return fields, blocks and values of each further track."""
    tracks = []
    for number, track in enumerate(opened.tracks, start=1):
        blocks = [block_of(opened, block, number) for block in range(opened.n_blocks)]
        values = np.empty((opened.n_frames, track.n_items, track.n_columns), track.dtype)
        method_named(opened.method).frames(opened, None).fill(values, 0, number)
        fields = {key: getattr(track, key) for key in ("name", "unit", "kind", "domain", "coding")}
        tracks.append((fields | {"bound": track.bound}, blocks, Floats(values)))
    return tracks


def surface_of(surface, faces):
    """Return the surface of these triangles as plain values."""
    sizes = surface.face_sizes
    return {
        "polygons": None if sizes is None else sizes.tolist(),
        "triangle corners": triangle_corners(surface.sizes(len(faces)), faces).ravel().tolist(),
        "attributes": [attribute_of(attribute) for attribute in surface.attributes],
        "groups": [
            {"name": group.name, "labels": list(group.labels), "numbers": group.numbers.tolist()}
            for group in surface.groups
        ],
        "parts": [[part.name, part.n_verts, part.n_faces] for part in surface.parts],
        "materials": [material_of(material) for material in surface.materials],
        "images": [
            {"name": image.name, "type": image.mime_type, "data": image.data}
            for image in surface.images
        ],
        "hard edges": [] if surface.hard_edges is None else surface.hard_edges.tolist(),
    }


def attribute_of(attribute):
    values = attribute.values.astype(attribute.values.dtype.newbyteorder("<"))
    return {
        "name": attribute.name,
        "kind": str(attribute.kind),
        "domain": str(attribute.domain),
        "type": LETTERS[attribute.values.dtype.str[1:]],
        "width": values.shape[1],
        "values": [[row.tobytes()] for row in values],
        "rows": None if attribute.indices is None else attribute.indices.tolist(),
    }


def numbers_of(item, names):
    values = [getattr(item, name) for name in names]
    return [x for value in values for x in (value if isinstance(value, tuple) else [value])]


def material_of(material):
    assert ALPHA_MODES[0] == "opaque"
    return {
        "name": material.name,
        "alpha mode": str(material.alpha_mode),
        "numbers": numbers_of(material, MATERIAL_NUMBERS),
        "double sided": material.double_sided,
        "unlit": material.unlit,
        "textures": {
            slot: texture_of(material.textures[slot]) for slot in SLOTS if slot in material.textures
        },
    }


def texture_of(texture):
    filters = [
        0 if name is None else 1 + FILTERS.index(name)
        for name in (texture.magnified, texture.shrunk)
    ]
    return {
        "image": texture.image,
        "uv": texture.uv,
        "wrap": [WRAPS.index(texture.wrap_u), WRAPS.index(texture.wrap_v)],
        "channels": "".join(letter for letter in CHANNELS if letter in texture.channels),
        "filters": filters,
        "numbers": numbers_of(texture, TEXTURE_NUMBERS),
    }
