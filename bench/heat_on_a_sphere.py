"""Heat diffusion on a pulsating, rotating sphere, with a known solution.

Vertices have temperature and velocity, faces a heat flow.

Spots of heat on a sphere of radius r(t) are sums of heat kernels: each spherical harmonic of
degree l decays by exp(-l (l + 1) s), where s grows by k dt / r^2.
"""

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

import meshreel

Floats = npt.NDArray[np.float64]

FPS = 25.0
RADIUS_M, BREATH_M, BREATHS_PER_S = 1.0, 0.25, 0.4
SPIN_RAD_PER_S = np.array([0.2, 0.9, 0.1])
CONDUCTION_M2_PER_S, ROOM_K = 0.01, 293.0
SPOTS = (
    ((1.0, 0.2, 0.1), 0.010, 6.0),
    ((-0.3, 0.9, 0.4), 0.004, 2.0),
    ((0.1, -0.5, -1.0), 0.030, 9.0),
)
"""Direction, initial spread and temperature of each spot of heat."""
DEGREES = 48
"""Number of spherical harmonics; the omitted ones are initially below 1e-3 K."""


def sphere(n_verts: int) -> tuple[Floats, npt.NDArray[np.int32]]:
    """Return points on the unit sphere along a spiral, and outward-facing triangles."""
    index = np.arange(n_verts) + 0.5
    height, angle = 1 - 2 * index / n_verts, np.pi * (1 + np.sqrt(5)) * index
    radius = np.sqrt(1 - height**2)
    points = np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=1)
    faces = ConvexHull(points).simplices.astype(np.int32)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    is_inward = np.einsum("fa,fa->f", np.cross(b - a, c - a), a) < 0
    faces[is_inward] = faces[is_inward][:, [0, 2, 1]]
    return points, faces


def kernel(cosines: Floats, spread: float) -> Floats:
    """Return the heat kernel of the unit sphere: the sum of (2 l + 1) exp(-l (l + 1) s) P_l."""
    previous, legendre, total = np.zeros_like(cosines), np.ones_like(cosines), np.ones_like(cosines)
    for degree in range(1, DEGREES):
        following = ((2 * degree - 1) * cosines * legendre - (degree - 1) * previous) / degree
        previous, legendre = legendre, following
        total += (2 * degree + 1) * np.exp(-degree * (degree + 1) * spread) * legendre
    return total


def rotated(points: Floats, time_s: float) -> Floats:
    """Return the points, rotated with the sphere (Rodrigues)."""
    speed = float(np.linalg.norm(SPIN_RAD_PER_S))
    axis, angle = SPIN_RAD_PER_S / speed, speed * time_s
    along = (points @ axis)[:, None] * axis
    result: Floats = along + np.cos(angle) * (points - along)
    result += np.sin(angle) * np.cross(axis, points)
    return result


def heat_flow(positions: Floats, faces: npt.NDArray[np.int32], temperature: Floats) -> Floats:
    """Return the heat flow of each face, from the temperature gradient of its corners."""
    a, b, c = np.moveaxis(positions[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.einsum("fa,fa->f", normal, normal)[:, None]
    ta, tb, tc = np.moveaxis(temperature[faces], 1, 0)[..., None]
    gradient: Floats = (np.cross(normal, c - b) * ta + np.cross(normal, a - c) * tb) / squared
    gradient += np.cross(normal, b - a) * tc / squared
    return -CONDUCTION_M2_PER_S * gradient


def simulate(n_verts: int = 10_000, n_frames: int = 150) -> meshreel.MeshSequence:
    """Return the sphere in meters with its tracks. Deterministic."""
    points, faces = sphere(n_verts)
    axes = [np.array(axis) / np.linalg.norm(axis) for axis, _, _ in SPOTS]
    cosines = [points @ axis for axis in axes]
    positions = np.empty((n_frames, n_verts, 3), np.float32)
    velocity = np.empty_like(positions)
    temperature = np.empty((n_frames, n_verts), np.float32)
    flow = np.empty((n_frames, len(faces), 3), np.float32)
    spread = 0.0
    for frame in range(n_frames):
        time_s, phase = frame / FPS, 2 * np.pi * BREATHS_PER_S * frame / FPS
        radius_m = RADIUS_M + BREATH_M * np.sin(phase)
        growth = 2 * np.pi * BREATHS_PER_S * BREATH_M * np.cos(phase)
        now = rotated(points, time_s)
        positions[frame] = radius_m * now
        velocity[frame] = growth * now + np.cross(SPIN_RAD_PER_S, radius_m * now)
        kelvin = np.full(n_verts, ROOM_K)
        for cosine, (_, initial, warmth) in zip(cosines, SPOTS, strict=True):
            kelvin += warmth * kernel(cosine, initial + spread)
        temperature[frame] = kelvin
        flow[frame] = heat_flow(radius_m * now, faces, kelvin)
        spread += CONDUCTION_M2_PER_S / FPS / radius_m**2
    tracks = {
        "temperature": meshreel.Track(temperature, unit="K"),
        "velocity": meshreel.Track(velocity, kind="velocity", unit="m/s"),
        "heat flow": meshreel.Track(flow, "face", unit="K m/s"),
    }
    return meshreel.MeshSequence(positions, faces, fps=FPS, name="sphere", tracks=tracks)
