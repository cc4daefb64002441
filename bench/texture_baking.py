"""Bake known textures of a raw capture; compare renderings with those of the raw frames.

    python bench/texture_baking.py samba.npz --remesh --frames 24
    python bench/texture_baking.py liam/ --frames 40

Every raw frame gets texture coordinates of its own by xatlas (a capture keeps its own), and three
images: of positions in the first frame with `--remesh`, which bench/registration.py describes, else
of positions in space. Prints the time of baking, the bytes of the video, and the PSNR of unlit
renderings from eight views: of the images on the registered mesh, and of the video on the decoded
one; of the pixels that show the model in either picture, of those inside both outlines, and of
whole pictures.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from itertools import repeat
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from scipy.ndimage import map_coordinates

import meshreel
from meshreel import Attribute, Domain, Kind, MeshFrame, MeshSequence, Surface
from meshreel.arrays import Floats
from meshreel.codec.error_bounds import bound_of
from meshreel.formats.baked_textures import TextureJob, open_textures
from meshreel.formats.load import load_any
from meshreel.formats.options import ReadOptions
from meshreel.model.notes import Notes
from meshreel.model.sequence import frames_of, segment_of_frame
from meshreel.registration.baking import Atlas, barycentric, generate_uv, sample_image
from meshreel.registration.register import Registration, register
from meshreel.registration.transfer import items_at_corners
from meshreel.registration.triangle_mesh import TriangleMesh
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.visibility import inverse_depths, visible_faces
from meshreel.studies.timing import timed_once
from registration import remeshed

N_VIEWS = 8
PICTURE_PX = 600
SUPERSAMPLE = 4
BACKGROUND = 255.0
QUALITY = 80


Picture = tuple[Floats, npt.NDArray[np.int64]]
"""Colors, and the number of samples of each pixel that show the model."""

Box = tuple[Floats, Floats]


def gradients(unit: Floats) -> Floats:
    """Gradients along two axes and 40 stripes per longest side, of shape (N, 3), from 0 to 1."""
    colors = np.column_stack([unit[:, 1], 1 - unit[:, 1], unit[:, 0] + 0.3])
    colors[:, 2] *= 0.85 + 0.15 * np.sin(2 * np.pi * 40 * unit[:, 1])
    return np.clip(colors, 0, 1)


def checkerboard(unit: Floats) -> Floats:
    """The gradients, and a checkerboard of 24 cells per longest side."""
    checker = np.floor(unit * 24).astype(int).sum(axis=1) % 2
    return np.asarray(gradients(unit) * (0.45 + 0.55 * checker[:, None]))


def noise(unit: Floats) -> Floats:
    """Random colors at 12, 24 and 48 points per longest side, interpolated and added."""
    random = np.random.default_rng(0)
    total, weight = np.zeros((len(unit), 3)), 0.0
    for octave in range(3):
        lattice = random.random((3, 51, 51, 51))
        places = unit.T * 12 * 2**octave
        layers = [map_coordinates(values, places, order=1, mode="grid-wrap") for values in lattice]
        total += np.column_stack(layers) / 2**octave
        weight += 1 / 2**octave
    return np.asarray(total / weight)


PATTERNS: dict[str, Callable[[Floats], Floats]] = {
    function.__name__: function for function in (checkerboard, gradients, noise)
}
"""Colors, from 0 to 1, of points in longest sides of the box."""


def with_uv(frame: MeshFrame, surface: Surface, side: int) -> MeshSequence:
    """Return a raw frame with texture coordinates; its own if it has some."""
    uvs = surface.of_kind(Kind.UV)
    if not uvs:
        made = generate_uv(frame.vertices.astype(np.float32), frame.faces, (side, side))
        uvs = (Attribute("uv", Kind.UV, Domain.CORNER, made),)
    surface = Surface(attributes=uvs[:1])
    return MeshSequence(frame.vertices[None], frame.faces, 30.0, surface=surface)


def corners_of(frame: MeshSequence) -> Floats:
    """Return the texture coordinates at corners, of shape (M, 3, 2)."""
    (uv,) = frame.surface.of_kind(Kind.UV)
    items = items_at_corners(frame, uv.domain)
    return uv.per_item()[items].astype(np.float64)


def raw_textures(
    frame: MeshSequence, truth: MeshFrame, rest: Floats, box: Box, side: int
) -> Iterator[tuple[str, Image.Image]]:
    """Yield the name of each pattern and the image of a raw frame.

    Parameters
    ----------
    truth : MeshFrame
        The surface of the frame whose vertices are known in the first frame.
    rest : float array of shape (V, 3)
        Those positions.
    """
    atlas = Atlas.of_corners(corners_of(frame), (side, side))
    corners = frame.vertices[0][frame.faces[atlas.faces]].astype(np.float64)
    points = np.einsum("nk,nkc->nc", atlas.weights, corners)
    surface = TriangleMesh(truth.vertices.astype(np.float64), truth.faces)
    result = surface.closest(points)
    origins = np.einsum("nk,nkc->nc", result.weights, rest[truth.faces[result.faces]])
    unit = (origins - box[0]) / (box[1] - box[0]).max()
    for name, colors in PATTERNS.items():
        image = np.rint(255 * colors(unit)).astype(np.uint8)
        yield name, Image.fromarray(image[atlas.nearest])


def rendered(frame: MeshFrame, corners: Floats, image: Image.Image, camera: Camera) -> Picture:
    """Return an unlit picture."""
    side = camera.width
    vertices = frame.vertices.astype(np.float64)
    points, depths = camera.project(vertices)
    near = inverse_depths(depths)
    faces = visible_faces(points, near, frame.faces, (side, side))
    pixels = np.flatnonzero(faces >= 0)
    owners = faces[pixels]
    centers = np.stack([pixels % side, pixels // side], axis=1).astype(np.float64) + 0.5
    weights = barycentric(points[frame.faces[owners]], centers) * near[frame.faces[owners]]
    weights /= weights.sum(axis=1, keepdims=True)
    uv = np.einsum("nk,nkc->nc", weights, corners[owners])
    colors = np.full((side * side, 3), BACKGROUND)
    colors[pixels] = sample_image(np.asarray(image), uv)
    n = side // SUPERSAMPLE
    picture = colors.reshape(n, SUPERSAMPLE, n, SUPERSAMPLE, 3).mean(axis=(1, 3))
    n_shown = (faces >= 0).reshape(n, SUPERSAMPLE, n, SUPERSAMPLE).sum(axis=(1, 3))
    return picture, n_shown


def views(
    raw: MeshFrame,
    raw_corners: Floats,
    raw_image: Image.Image,
    other: MeshFrame,
    corners: Floats,
    image: Image.Image,
) -> Iterator[tuple[Picture, Picture]]:
    """Yield renderings of both from each view."""
    for number in range(N_VIEWS):
        side = PICTURE_PX * SUPERSAMPLE
        camera = fit_camera(
            raw.vertices, azimuth_deg=360 * number / N_VIEWS, width=side, height=side
        )
        yield (
            rendered(raw, raw_corners, raw_image, camera),
            rendered(other, corners, image, camera),
        )


class Errors:
    """Squared errors of pairs of pictures."""

    def __init__(self) -> None:
        self._sums = np.zeros(3)  # of pixels that show the model; inside the outlines; of all
        self._counts = np.zeros(3)
        self.worst = np.inf

    def add(self, first: Picture, second: Picture) -> None:
        """Add a raw picture and another one."""
        squares = (first[0] - second[0]) ** 2
        n_shown = np.stack([first[1], second[1]])
        shown = squares[n_shown.max(axis=0) > 0]
        inside = squares[n_shown.min(axis=0) == SUPERSAMPLE**2]
        self._sums += shown.sum(), inside.sum(), squares.sum()
        self._counts += shown.size, inside.size, squares.size
        self.worst = min(self.worst, psnr(float(shown.mean())))

    def __str__(self) -> str:
        model, inside, whole = map(psnr, self._sums / self._counts)
        return (
            f"{model:.2f} dB of the model, worst picture {self.worst:.2f} dB; {inside:.2f} dB "
            f"inside the outlines; {whole:.2f} dB of whole pictures"
        )


def main() -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="a capture with texture coordinates, or a sequence")
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--every", type=int, default=6, help="distance of rendered frames")
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--remesh", action="store_true")
    parser.add_argument("--side", type=int, default=1024, help="of the images, in texels")
    parser.add_argument("--pictures", type=Path, help="folder for renderings")
    arguments = parser.parse_args()
    given = load_any(arguments.source, ReadOptions(matches_frames=False))
    numbers = range(arguments.first, arguments.first + arguments.frames)
    sequence = MeshSequence.of_segments(given.segments).part(numbers)
    truth = list(sequence)
    surfaces = [
        sequence.segments[segment_of_frame(sequence.starts, n)[0]].surface
        for n in range(len(truth))
    ]
    if arguments.remesh:
        meshes = remeshed(truth)
        surfaces = [Surface()] * len(truth)
    else:
        meshes = truth
    raw = MeshSequence.of_segments(map(with_uv, meshes, surfaces, repeat(arguments.side)))
    box = sequence.extent.low, sequence.extent.high
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for number, known in enumerate(truth):
            rest = (truth[0] if arguments.remesh else known).vertices.astype(np.float64)
            frame = frame_of(raw, number)
            for name, image in raw_textures(frame, known, rest, box, arguments.side):
                image.save(folder / f"{name}_{number:04d}.png")
        registration = register(raw, bound_of(arguments.tolerance), quality=QUALITY)
        for name in PATTERNS:
            measure(raw, registration, name, folder, arguments)


def measure(
    raw: MeshSequence,
    registration: Registration,
    pattern: str,
    folder: Path,
    arguments: argparse.Namespace,
) -> None:
    """Bake the images of a pattern, and print the figures."""
    textures = [folder / f"{pattern}_{number:04d}.png" for number in range(raw.n_frames)]
    notes = Notes()
    jobs = [
        TextureJob.checked(textures, folder / name, raw, overwrite=True)
        for name in ("baked_%04d.png", "baked.mp4")
    ]
    textured = jobs[0].prepared(registration, notes)
    data = meshreel.encode(textured.sequence, quality=QUALITY, order="drop")
    decoded = meshreel.decode(data)
    lengths = [segment.n_frames for segment in textured.sequence.segments]
    print(f"{pattern}: {raw.n_frames} frames; segments of {lengths} frames; {textured.distances}; "
          f"{notes}; mesh {8e-3 * len(data) / raw.n_frames:.1f} kbit per frame")  # fmt: skip
    for job, shown in zip(jobs, (textured.sequence, decoded), strict=True):
        _, times = timed_once(partial(job.write, textured, shown))
        seconds = times.processor / raw.n_frames
        n_bytes = sum(path.stat().st_size for path in job.paths)
        kilobits = 8e-3 * n_bytes / raw.n_frames
        print(f"{job.output.name}: {seconds:.2f} processor seconds per frame, without the video "
              f"encoder; {kilobits:.0f} kbit per frame", flush=True)  # fmt: skip
    video = list(open_textures(folder / "baked.mp4").images())
    opened = [Image.open(folder / f"baked_{number:04d}.png") for number in range(raw.n_frames)]
    cases: dict[str, tuple[MeshSequence, list[Any]]] = {
        "images on the registered mesh": (textured.sequence, opened),
        "video on the decoded mesh": (decoded, video),
    }
    for name, (shown, images) in cases.items():
        errors = Errors()
        for number in range(0, raw.n_frames, arguments.every):
            pairs = views(
                raw[number],
                corners_of(frame_of(raw, number)),
                Image.open(textures[number]),
                shown[number],
                corners_of(frame_of(shown, number)),
                images[number],
            )
            for view, pair in enumerate(pairs):
                errors.add(*pair)
                if arguments.pictures:
                    file_name = f"{pattern}_{name.split()[0]}_{number:03d}_{view}.png"
                    save(arguments.pictures / file_name, pair)
        print(f"{name}: {errors}", flush=True)


def frame_of(sequence: MeshSequence, number: int) -> MeshSequence:
    """Return the mesh of a frame with its surface."""
    return frames_of(sequence.segments[segment_of_frame(sequence.starts, number)[0]], range(1))


def save(path: Path, pair: tuple[Picture, Picture]) -> None:
    """Save both pictures, and their difference times 4."""
    path.parent.mkdir(exist_ok=True)
    (first, _), (second, _) = pair
    row = [first, second, np.minimum(4 * np.abs(first - second), 255)]
    Image.fromarray(np.concatenate(row, axis=1).astype(np.uint8)).save(path)


def psnr(mean_square: float) -> float:
    """Return the PSNR of 8-bit colors."""
    return float(10 * np.log10(255**2 / mean_square))


if __name__ == "__main__":
    main()
