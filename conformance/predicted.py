"""Tracks that positions let expect: velocities by differences, normals of the surface."""

import math
import struct
from array import array

EXACT, TURNS, BACKWARD, CENTRAL, FORWARD, EXACT_BACKWARD = 1, 2, 3, 4, 5, 6
"""Codings of TRACK; exact ones by differences go on like those with modes."""


def is_exact(coding):
    return coding == EXACT or coding >= EXACT_BACKWARD


def predicted_values(said, decoded, positions, mesh, polygons, letter, of_rows):
    """Values of a track in a block.

    Parameters
    ----------
    said : dict
        What TRACK says.
    decoded : list of float
        The frames of the block, not rounded; two numbers of a normal, three of a velocity.
        Integers of exact values.
    positions : array of float
        Of the block, as they go out.
    mesh : Items
        The vertices: internal faces, and the internal number of each that goes out.
    polygons : Polygons
    letter : str
        "f" or "d", as which values are rounded.
    of_rows : dict of int, or None
        The vertex of each row, where corners share rows.
    """
    n, coding = 3 * mesh.n, said["coding"]
    frames = [list(positions[at : at + n]) for at in range(0, len(positions), n)]
    found = array(letter)
    if coding >= EXACT_BACKWARD:
        for frame in differences(coding - 3, frames):
            for one in frame:
                found.append(moved(said["rate"] * one, decoded[len(found)], letter))
        return found
    if coding != TURNS:
        for expected in differences(coding, frames):
            for one in expected:
                found.append(said["rate"] * one + decoded[len(found)])
        return found
    for frame in frames:
        points = [frame[at : at + 3] for at in range(0, n, 3)]
        for normal in normals_of(said["domain"], points, mesh, polygons, of_rows):
            place = 2 * (len(found) // 3)
            found.extend(turned(normal, *decoded[place : place + 2]))
    return found


def moved(expected, by, letter):
    """The float that is so many places behind one that is rounded first."""
    try:
        rounded = struct.unpack("<" + letter, struct.pack("<" + letter, expected))[0]
    except OverflowError:
        rounded = math.inf
    (bits,) = struct.unpack(INTEGERS[letter], struct.pack("<" + letter, rounded))
    half = 2 ** (8 * struct.calcsize("<" + letter) - 1)
    place = turned_over(bits if math.isfinite(rounded) else 0, half)
    place = (place + by + half) % (2 * half) - half
    return float_at(turned_over(place, half), letter)


INTEGERS = {"f": "<i", "d": "<q"}
"""Integers of as many bytes as floats have."""


def turned_over(number, half):
    """The place of bits, and the bits of a place."""
    return number if number >= 0 else -half - 1 - number


def float_at(bits, letter):
    """The float of these bits."""
    return struct.unpack("<" + letter, struct.pack(INTEGERS[letter], bits))[0]


def differences(coding, frames):
    """Of each frame what it is apart from those beside it."""
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


def normals_of(domain, points, mesh, polygons, of_rows):
    """Normals of vertices, faces, corners or rows, of length 1 or 0."""
    if domain == 1:
        of_triangle = [face for face, size in enumerate(polygons.sizes) for _ in range(size - 2)]
        triangles = zip(polygons.triangles, of_triangle, strict=True)
        return sums(points, [(one, (face,)) for one, face in triangles], len(polygons.sizes))
    out = {internal: vertex for vertex, internal in enumerate(mesh.order)}
    triangles = [tuple(out[one] for one in triangle) for triangle in mesh.faces]
    of_vertices = sums(points, [(one, one) for one in triangles], len(points))
    if domain in (0, 3):
        return of_vertices
    if of_rows is not None:
        return [of_vertices[of_rows[row]] for row in range(len(of_rows))]
    return [of_vertices[vertex] for vertex in polygons.vertices_of_corners()]


def sums(points, triangles, n):
    """Sums of the cross products of triangles over what they are of, divided by their length."""
    found = [[0.0, 0.0, 0.0] for _ in range(n)]
    for (a, b, c), items in triangles:
        u = [points[b][i] - points[a][i] for i in range(3)]
        w = [points[c][i] - points[a][i] for i in range(3)]
        for item in items:
            for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                found[item][i] += u[j] * w[k] - u[k] * w[j]
    for one in found:
        x, y, z = one
        length = math.sqrt((x * x + y * y) + z * z)
        is_there = length > 0 and math.isfinite(length)
        one[:] = [number / length if is_there else 0.0 for number in one]
    return found


def turned(normal, a, b):
    """A normal, turned by two numbers."""
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
        ((1 - k) * one + (a * p + b * q)) / (1 + k)
        for one, p, q in zip(normal, along_a, along_b, strict=True)
    ]
