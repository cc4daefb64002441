"""Baking of the textures of raw frames into the texture coordinates of their segments."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image as PillowImage

from meshreel.arrays import Bytes, Floats, Integers, Singles
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Faces, MeshSequence, frames_of, segment_of_frame
from meshreel.model.surface import Attribute, Domain, Kind
from meshreel.model.tracks import TrackKind
from meshreel.registration.register import Registration
from meshreel.registration.transfer import RawFrame, attributes_of, interpolated, items_at_corners
from meshreel.rendering.visibility import visible_faces
from meshreel.runtime.extras import REGISTER_SCIPY, REGISTER_XATLAS
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import chunks

MAX_OVERLAP = 0.02
"""Largest share of the area of texture coordinates that may be outside the image, or covered by
another triangle."""

PADDING = 4
"""Texels between the charts of generated texture coordinates."""

CHUNK_TEXELS = 1 << 18
"""Number of texels baked at once; limits the working memory to about 100 MB."""

COMBINE = (
    "combine the images of each frame into one, and move its texture coordinates accordingly (the "
    "texture atlas of a modeling program), or register without textures"
)
"""What to do with frames of several images."""

Size = tuple[int, int]
"""Width and height in texels."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """Where the texels of an image are on a mesh.

    Attributes
    ----------
    size : tuple of 2 ints
    faces : int64 array of shape (N,)
        The triangle at the center of each texel that is on one; texels in ascending order.
    weights : float32 array of shape (N, 3)
        Barycentric coordinates of the center in this triangle.
    nearest : int32 array of shape (height, width)
        The nearest of these texels, for every texel of the image.
    """

    size: Size
    faces: Integers
    weights: Singles
    nearest: Integers

    @classmethod
    def of_corners(cls, corners: Floats, size: Size) -> "Atlas":
        """Return the atlas of texture coordinates at corners, of shape (M, 3, 2)."""
        width, height = size
        points = _in_texels(corners, size)
        faces = _faces_of_texels(points, size)
        texels = np.flatnonzero(faces >= 0)
        order = np.argsort(faces[texels], kind="stable")  # neighbors share nodes of search trees
        texels = texels[order]
        distances = REGISTER_SCIPY.load("ndimage").distance_transform_edt
        ranks = np.zeros(width * height, np.int32)
        ranks[texels] = np.arange(len(texels), dtype=np.int32)
        is_free = (faces < 0).reshape(height, width)
        rows, columns = distances(is_free, return_distances=False, return_indices=True)
        owners = faces[texels]
        centers = np.stack([texels % width, texels // width], axis=1).astype(np.float64) + 0.5
        weights = barycentric(points[owners], centers).astype(np.float32)
        return cls(size, owners, weights, ranks.reshape(height, width)[rows, columns])


def _in_texels(corners: Floats, size: Size) -> Floats:
    """Texture coordinates in texels from the upper left corner of the image."""
    return np.asarray((corners * [1, -1] + [0, 1]) * size, np.float64)


def _faces_of_texels(points: Floats, size: Size) -> Integers:
    """The triangle at the center of each texel, or -1; of shape (height * width,)."""
    faces = np.arange(3 * len(points), dtype=np.int32).reshape(-1, 3)
    return visible_faces(points.reshape(-1, 2), np.ones(3 * len(points)), faces, size)


def barycentric(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates of points of shape (N, 2) in triangles of shape (N, 3, 2)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = points - corners[:, 0]
    area = _cross(first, second)
    s, t = _cross(offset, second) / area, _cross(first, offset) / area
    return np.clip(np.stack([1 - s - t, s, t], axis=1), 0.0, 1.0)


def _cross(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def check_textured(raw: MeshSequence) -> None:
    """Raise `InvalidInputError` with the first frame whose texture cannot be baked.

    It lacks texture coordinates, or its faces have several images.
    """
    first = 0
    for segment in raw.segments:
        uv_tracks = [track for track in segment.tracks.values() if track.kind is TrackKind.UV]
        if not uv_tracks and not segment.surface.of_kind(Kind.UV):
            raise InvalidInputError(
                f"frame {first} has no texture coordinates, so its texture cannot be baked"
            )
        surface = segment.surface
        names = {
            group.labels[number]
            for group in surface.groups
            if group.name == "material"
            for number in np.unique(group.numbers[group.numbers >= 0]).tolist()
        }
        textures = [each.base_color_texture for each in surface.materials if each.name in names]
        n_images = len({texture.image for texture in textures if texture is not None})
        if n_images > 1:
            raise InvalidInputError(
                f"the materials of frame {first} have {n_images} color images, but only one image "
                f"per frame can be baked; {COMBINE}"
            )
        first += segment.n_frames


def with_atlases(registration: Registration, size: Size) -> tuple[Registration, int]:
    """Return a registration whose segments have texture coordinates that can be baked into.

    Those of the key are kept if each texel belongs to one triangle. Otherwise they are replaced,
    and the materials of the key removed, because their images do not fit.

    Returns
    -------
    registration : Registration
    n_generated : int
        Number of segments with new texture coordinates.
    """
    segments, n_generated = list(registration.sequence.segments), 0
    for registered in registration.segments:
        number, _ = segment_of_frame(registration.sequence.starts, registered.first)
        segment = segments[number]
        uvs = segment.surface.of_kind(Kind.UV)
        if uvs and _is_atlas(_corners(uvs[0]), size):
            continue
        local = registered.key - registered.first
        key = registration.frames.normalized(segment.read(local, local + 1)[0])
        new_uv = generate_uv(key.astype(np.float32), segment.faces, size)
        others = [each for each in segment.surface.attributes if each.kind is not Kind.UV]
        uv = Attribute("uv", Kind.UV, Domain.CORNER, new_uv[:0]).indexed(new_uv)
        surface = replace(segment.surface.without_materials(), attributes=(uv, *others))
        loaded = frames_of(segment, range(segment.n_frames))
        segments[number] = loaded.replace(surface=surface)
        n_generated += 1
    with_uvs = MeshSequence.of_segments(
        segments, registration.sequence.name, registration.sequence.timing
    )
    return replace(registration, sequence=with_uvs), n_generated


def bake(
    registration: Registration,
    sequence: MeshSequence | ReelFile,
    images: Iterable[PillowImage.Image],
    size: Size,
    progress: Progress = silent,
) -> Iterator[PillowImage.Image]:
    """Yield the texture of each frame for the texture coordinates of its segment.

    Every texel has the color of the raw frame at the closest point of its surface. Texels outside
    of triangles have the color of the nearest texel inside. Frames without a surface keep their
    image.

    Parameters
    ----------
    registration : Registration
        From `with_atlases`.
    sequence : MeshSequence or ReelFile
        The registered sequence, or preferably the decoded one: colors are then taken at the decoded
        vertices, so that coding errors do not displace them.
    images : iterable of Pillow images
        The texture of each raw frame, in RGB.
    size : tuple of 2 ints
        Width and height of the textures.

    Raises
    ------
    InvalidInputError
        If there are fewer images than frames.
    """
    starts = {segment.first for segment in registration.segments}
    image_iterator = iter(images)
    *firsts, n_frames = sequence.starts
    for index, first in enumerate(firsts):
        segment, atlas = sequence.segments[index], None
        if first in starts:
            atlas = Atlas.of_corners(_corners(segment.surface.of_kind(Kind.UV)[0]), size)
        for local in range(segment.n_frames):
            number = first + local
            image = next(image_iterator, None)
            if image is None:
                raise InvalidInputError(f"there is no texture image for frame {number}")
            if atlas is None:
                yield image.resize(size)
            else:
                positions = registration.frames.normalized(segment.read(local, local + 1)[0])
                raw = registration.frames.raw_frame(number)
                colors = _bake_colors(atlas, positions[segment.faces], raw, image)
                yield PillowImage.fromarray(colors[atlas.nearest])
            progress("baking", Count(number + 1, n_frames, "frames"))


def _bake_colors(atlas: Atlas, corners: Floats, raw: RawFrame, image: PillowImage.Image) -> Bytes:
    """Return the colors of the texels of an atlas that belong to triangles, of shape (N, 3)."""
    pixels = np.asarray(image)
    (uv, *_) = (attribute for attribute in attributes_of(raw.frame) if attribute.kind is Kind.UV)
    items = items_at_corners(raw.frame, uv.domain)
    values = uv.per_item()
    colors = np.empty((len(atlas.faces), 3), np.uint8)
    for chunk in chunks(len(colors), CHUNK_TEXELS):
        weights = atlas.weights[chunk]
        points = np.einsum("nk,nkc->nc", weights, corners[atlas.faces[chunk]])
        closest = raw.closest(points)
        colors[chunk] = sample_image(pixels, interpolated(values, items, closest))
    return colors


def sample_image(pixels: Bytes, uv: Floats) -> Bytes:
    """Return the colors of a repeated image at texture coordinates, interpolated.

    Parameters
    ----------
    pixels : uint8 array of shape (height, width, 3)
    uv : float array of shape (N, 2)
        v points up.
    """
    height, width, _ = pixels.shape
    points = _in_texels(uv, (width, height)) - 0.5
    low = np.floor(points).astype(np.int64)
    right, down = (points - low).astype(np.float32).T[..., None]
    (left, top), (next_x, next_y) = (low % (width, height)).T, ((low + 1) % (width, height)).T
    above = pixels[top, left] * (1 - right) + pixels[top, next_x] * right
    below = pixels[next_y, left] * (1 - right) + pixels[next_y, next_x] * right
    return np.asarray(np.rint(above * (1 - down) + below * down), np.uint8)


def _corners(uv: Attribute) -> Floats:
    """Texture coordinates at the corners of registered triangles, of shape (M, 3, 2)."""
    return uv.per_item().reshape(-1, 3, 2).astype(np.float64)


def _is_atlas(corners: Floats, size: Size) -> bool:
    """Whether almost every triangle has its own texels."""
    points = _in_texels(corners, size)
    areas = np.abs(_cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])) / 2
    n_covered = np.count_nonzero(_faces_of_texels(points, size) >= 0)
    return bool(n_covered >= (1 - MAX_OVERLAP) * areas.sum() > 0)


def generate_uv(vertices: Singles, faces: Faces, size: Size) -> Singles:
    """Return texture coordinates of each corner, of shape (3 M, 2), in disjoint charts."""
    xatlas = REGISTER_XATLAS.load()
    atlas, options = xatlas.Atlas(), xatlas.PackOptions()
    atlas.add_mesh(vertices, faces.astype(np.uint32))
    options.padding, options.resolution = PADDING, max(size)
    atlas.generate(pack_options=options)
    _, corners, uv = atlas[0]
    return np.asarray(uv[corners.ravel()], np.float32)
