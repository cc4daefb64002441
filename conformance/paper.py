"""Integers of the paper's methods: ANCHOR_VERTICES to EXACT of docs/format.md."""

from itertools import accumulate

from conformance.bits import integers, need
from conformance.container import OF_PAPER, Payload
from conformance.patterns import read_patterns, row_before, same_step


def read_anchors(payload, n_verts):
    """Return the anchors, ascending."""
    payload = Payload(payload)
    n_anchors = payload.varint()
    need(n_anchors <= n_verts)
    (gaps,) = integers(payload.rest(), [n_anchors])
    anchors = list(accumulate(gaps))
    need(anchors == sorted(set(anchors)) and all(0 <= v < n_verts for v in anchors))
    return anchors


def table_of(row):
    """Return the table of a row of an axis, counted from 0."""
    return (row + 1).bit_length() - 1


def read_shape(payload, n_verts):
    """Return steps and integers of the shape of cotangent weights: x, y and z."""
    return read_curves(payload, 1, n_verts)


def read_rows(payload, n_rows, length):
    """Return the steps, and plain rows: 3 n_rows lists."""
    steps, payload = read_steps(payload, n_rows)
    tables = [table_of(row) for row in range(n_rows)] * 3
    return steps, integers(payload, [length] * (3 * n_rows), tables)


def read_curves(payload, n_rows, n_frames):
    """Return the steps, and curves: 3 n_rows lists."""
    steps, payload = read_steps(payload, n_rows)
    tables = [0] + [1 + table_of(row) for row in range(n_rows)] * 3
    orders, *rows = integers(payload, [3 * n_rows] + [n_frames] * (3 * n_rows), tables)
    for number, order in enumerate(orders):
        need(0 <= order <= 2)
        for _ in range(order):
            rows[number] = list(accumulate(rows[number]))
    return steps, rows


def read_steps(payload, n_rows):
    payload = Payload(payload)
    n_steps = payload.varint()
    need(n_steps in (1, n_rows))
    return [payload.number("f") for _ in range(n_steps)], payload.rest()


def read_exact(payload, n_frames, n_isolated, vertex_type):
    """Return the positions of isolated vertices, as bytes of each number of each frame."""
    need(payload[0] in (0, 1))
    predictors = (row_before, same_step)[payload[0]](n_frames)
    kind = "f" if vertex_type == 4 else "d"
    return read_patterns(payload[1:], 3 * n_isolated, kind, predictors)


def read_block(sections, header, n_anchors, n_isolated, previous):
    """Return the integers of a block, by section."""
    need(set(sections) <= OF_PAPER, "a section is misplaced")
    head = Payload(sections["BLOCK"])
    n_frames, n_modes = head.varint(), head.varint()
    head.end()
    block = {"frames": n_frames, "modes": n_modes}
    has_anchors, has_residuals = header.method not in ("v2v", "gft"), header.method == "gft"
    if has_anchors:
        need(sections["ANCHORS"][0] in (0, 1))
        has_residuals = sections["ANCHORS"][0] == 1
        steps, rows = read_rows(sections["ANCHORS"][1:], n_modes, n_anchors)
        block["anchor steps"], block["anchors"] = steps, rows
    if has_residuals:
        need(header.method in ("pca-qp", "pca-qs", "blocks", "gft"))
        steps, rows = read_curves(sections["ANCHOR_RESIDUALS"], n_anchors, n_frames)
        block["anchor residual steps"], block["anchor residuals"] = steps, rows
    if header.method == "gft":
        steps, rows = read_rows(sections["COEFFICIENTS"], n_modes, n_frames)
        block["coefficient steps"], block["coefficients"] = steps, rows
    else:
        basis, is_difference = sections["BASIS"], False
        if header.method == "blocks":
            need(basis[0] in (0, 1))
            basis, is_difference = basis[1:], basis[0] == 1
        block["basis steps"], rows = read_curves(basis, n_modes, n_frames)
        if is_difference:
            need(previous and previous["frames"] == n_frames)
            need(len(previous["basis"]) == len(rows))
            rows = [
                [a + b for a, b in zip(row, previous_row, strict=True)]
                for row, previous_row in zip(rows, previous["basis"], strict=True)
            ]
        block["basis"] = rows
        steps, rows = read_rows(sections["COEFFICIENTS"], n_modes, header.n_verts)
        block["coefficient steps"], block["coefficients"] = steps, rows
    if n_isolated:
        block["exact"] = read_exact(sections["EXACT"], n_frames, n_isolated, header.vertex_type)
    return block
