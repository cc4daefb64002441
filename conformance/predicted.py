"""Tracks predicted from positions: velocities from differences, normals from the surface."""

import math
import struct
from array import array

EXACT, ROTATED, BACKWARD, CENTRAL, FORWARD, EXACT_BACKWARD = 1, 2, 3, 4, 5, 6
"""Codings of TRACK; exact differences have the same order as those with modes."""


def is_exact(coding):
    return coding == EXACT or coding >= EXACT_BACKWARD


def predicted_values(track, decoded, positions, mesh, polygons, letter, row_vertices):
    """Return the values of a track in a block.

    Parameters
    ----------
    track : dict
        Fields of TRACK.
    decoded : list of float
        Decoded numbers of the block, not rounded: two per normal, three per velocity. Integers
        of exact values.
    positions : array of float
        Positions of the block, in output order.
    mesh : Items
        The vertices: internal faces, and internal numbers in output order.
    polygons : Polygons
    letter : str
        Type of the values: "f" or "d".
    row_vertices : dict of int, or None
        The vertex of each row, if corners share rows.
    """
    n, coding = 3 * mesh.n, track["coding"]
    frames = [list(positions[at : at + n]) for at in range(0, len(positions), n)]
    values = array(letter)
    if coding >= EXACT_BACKWARD:
        for frame in differences(coding - 3, frames):
            for difference in frame:
                values.append(offset(track["rate"] * difference, decoded[len(values)], letter))
        return values
    if coding != ROTATED:
        for frame in differences(coding, frames):
            for difference in frame:
                values.append(track["rate"] * difference + decoded[len(values)])
        return values
    for frame in frames:
        points = [frame[at : at + 3] for at in range(0, n, 3)]
        for normal in normals_of(track["domain"], points, mesh, polygons, row_vertices):
            at = 2 * (len(values) // 3)
            values.extend(rotated(normal, *decoded[at : at + 2]))
    return values


def offset(prediction, by, letter):
    """Return the float whose ordinal is `by` after that of the rounded prediction."""
    try:
        rounded = struct.unpack("<" + letter, struct.pack("<" + letter, prediction))[0]
    except OverflowError:
        rounded = math.inf
    return float_after(rounded if math.isfinite(rounded) else 0.0, by, letter)


def float_after(number, by, letter):
    """Return the float whose ordinal is `by` after that of a number of its type, modulo all."""
    (bits,) = struct.unpack(INTEGERS[letter], struct.pack("<" + letter, number))
    half = 2 ** (8 * struct.calcsize("<" + letter) - 1)
    ordinal = (flipped(bits, half) + by + half) % (2 * half) - half
    return float_of(flipped(ordinal, half), letter)


INTEGERS = {"f": "<i", "d": "<q"}
"""Integer types of the size of float types."""


def flipped(number, half):
    """Return the ordinal of bits, or the bits of an ordinal."""
    return number if number >= 0 else -half - 1 - number


def float_of(bits, letter):
    return struct.unpack("<" + letter, struct.pack(INTEGERS[letter], bits))[0]


def differences(coding, frames):
    """Yield the differences of each frame to its neighbors in time."""
    last = len(frames) - 1
    for t in range(len(frames)):
        first, second, by = max(t - 1, 0), min(t + 1, last), 1.0
        if 0 < t < last:
            if coding == BACKWARD:
                second = t
            elif coding == FORWARD:
                first = t
            else:
                by = 2.0
        elif t == last and t > 0:
            first, second = t - 1, t
        elif t == 0:
            first, second = 0, min(1, last)
        yield [(b - a) / by for a, b in zip(frames[first], frames[second], strict=True)]


def normals_of(domain, points, mesh, polygons, row_vertices):
    """Return normals of vertices, faces, corners or rows, of length 1 or 0."""
    if domain == 1:
        of_triangle = [face for face, size in enumerate(polygons.sizes) for _ in range(size - 2)]
        triangles = zip(polygons.triangles, of_triangle, strict=True)
        pairs = [(triangle, (face,)) for triangle, face in triangles]
        return unit_sums(points, pairs, len(polygons.sizes))
    output = {internal: vertex for vertex, internal in enumerate(mesh.order)}
    triangles = [tuple(output[v] for v in triangle) for triangle in mesh.faces]
    of_vertices = unit_sums(points, [(triangle, triangle) for triangle in triangles], len(points))
    if domain in (0, 3):
        return of_vertices
    if row_vertices is not None:
        return [of_vertices[row_vertices[row]] for row in range(len(row_vertices))]
    return [of_vertices[vertex] for vertex in polygons.vertices_of_corners()]


def unit_sums(points, triangles, n):
    """Sum the cross products of triangles over their items, and normalize the sums."""
    sums = [[0.0, 0.0, 0.0] for _ in range(n)]
    for (a, b, c), items in triangles:
        u = [points[b][i] - points[a][i] for i in range(3)]
        w = [points[c][i] - points[a][i] for i in range(3)]
        for item in items:
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                sums[item][i] += u[j] * w[k] - u[k] * w[j]
    for normal in sums:
        x, y, z = normal
        length = math.sqrt((x * x + y * y) + z * z)
        is_valid = length > 0 and math.isfinite(length)
        normal[:] = [number / length if is_valid else 0.0 for number in normal]
    return sums


def rotated(normal, a, b):
    """Return a normal, rotated by two numbers."""
    x, y, z = normal
    k = (a * a + b * b) / 4
    if not (x or y or z) or not math.isfinite(k):
        return 0.0, 0.0, 0.0
    side = -1.0 if 1 + z < 2**-20 else 1.0
    d = 1 + side * z
    across = -(x * y / d)
    along_a = 1 - x * x / d, across, -(side * x)
    along_b = across, 1 - y * y / d, -(side * y)
    return [
        ((1 - k) * n + (a * p + b * q)) / (1 + k)
        for n, p, q in zip(normal, along_a, along_b, strict=True)
    ]
