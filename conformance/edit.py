"""Faces and order of a mesh, which may be an edit of another one: EDIT of docs/format.md."""

from conformance.bits import integers, need
from conformance.connectivity import read_faces
from conformance.container import Payload
from conformance.order import read_order, twins_of


def read_mesh(container):
    """Return internal faces, their twins, the internal number of output vertices, and faces."""
    header, edits = container.header, container.all_of("EDIT")
    if not edits:
        return read_coded(container, header.n_verts, header.n_faces)[:4]
    need(len(edits) == 1 and header.method in ("reel", "lossless", "grid"), "EDIT is misplaced")
    payload = Payload(edits[0])
    counts = payload.varint(), payload.varint()
    need(all(counts), "the base mesh is empty")
    base, _, base_order, base_faces, numbers = read_coded(container, *counts)
    n_steps = [payload.varint() for _ in range(3)]
    totals = header.n_verts + counts[0], header.n_faces + counts[1], header.n_faces
    need(all(n <= total for n, total in zip(n_steps, totals, strict=True)), "EDIT is too long")
    lengths = [*3 * n_steps[:1], *3 * n_steps[1:2], 3 * n_steps[2]]
    *rows, differences = integers(payload.rest(), lengths)
    verts, listed = (
        items_after(zip(*rows[3 * i : 3 * i + 3], strict=True), counts[i], n_new)
        for i, n_new in enumerate((header.n_verts, header.n_faces))
    )
    need((len(verts), len(listed)) == (header.n_verts, header.n_faces), "EDIT does not fit")
    need(listed.count(None) == n_steps[2], "EDIT has other new faces")
    kept = {vertex: number for number, vertex in enumerate(verts) if vertex is not None}
    faces, corner = [], 0
    for face in listed:
        if face is None:
            three = []
            for _ in range(3):
                corner += differences.pop(0)
                need(0 <= corner < len(verts), "a vertex does not exist")
                three.append(corner)
            faces.append(tuple(three))
        else:
            need(all(v in kept for v in base_faces[face]), "a face lacks a vertex")
            faces.append(tuple(kept[v] for v in base_faces[face]))

    output = [number for _, number in sorted((v, n) for n, v in enumerate(base_order))]
    stored = [kept[v] for v in output if v in kept]
    stored += [number for number, vertex in enumerate(verts) if vertex is None]
    order = [number for _, number in sorted((v, n) for n, v in enumerate(stored))]
    internal = [
        tuple(order[kept[output[v]]] for v in base[number])
        for number in sorted(numbers[face] for face in listed if face is not None)
    ]
    internal += [
        tuple(order[v] for v in faces[number]) for number, face in enumerate(listed) if face is None
    ]
    return internal, twins_of(internal), order, faces


def read_coded(container, n_verts, n_faces):
    """Return faces, twins and order of CONNECTIVITY and ORDER, and the numbers of listed faces."""
    internal, twins = read_faces(container.only("CONNECTIVITY"), n_verts, n_faces)
    order, faces, numbers = list(range(n_verts)), internal, list(range(n_faces))
    if container.header.order < 2:
        order, faces, numbers = read_order(container.only("ORDER"), internal, n_verts)
    return internal, twins, order, faces, numbers


def items_after(steps, count, n_new):
    """Return, for each item after the steps, its number among `count` before them, or None."""
    items, n_used = [], 0
    for n_kept, n_dropped, n_inserted in steps:
        need(min(n_kept, n_dropped, n_inserted) >= 0, "EDIT has a negative number")
        need(n_used + n_kept + n_dropped <= count, "EDIT uses more than there is")
        need(len(items) + n_inserted <= n_new, "EDIT inserts too much")
        items += [*range(n_used, n_used + n_kept), *n_inserted * [None]]
        n_used += n_kept + n_dropped
    need(len(items) + count - n_used <= n_new, "EDIT keeps too much")
    return [*items, *range(n_used, count)]
