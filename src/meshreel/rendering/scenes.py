"""Views of a frame: the mesh, its original and the heat map of their difference."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers, Singles, Values
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.polygons import triangle_corners
from meshreel.metrics.compare import mesh_difference, require_comparable
from meshreel.metrics.heat import (
    HEATS,
    SURFACE_HEAT,
    Field,
    Heat,
    heat_field,
    surface_distance_percent,
)
from meshreel.metrics.reference import reference_of_box
from meshreel.model.colors import to_linear, to_srgb
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.materials import DEFAULT_MATERIAL
from meshreel.model.sequence import (
    Faces,
    FrameSource,
    MeshSequence,
    segment_of_frame,
    tracks_of_all,
)
from meshreel.model.surface import Domain, Kind, Surface
from meshreel.model.tracks import FACE_MASKS, describe_track, track_by_name
from meshreel.rendering.camera import Camera
from meshreel.rendering.colormap import colorize, round_up
from meshreel.rendering.cuts import Cut, cut_open
from meshreel.rendering.looks import TrackLook
from meshreel.rendering.painting import Color, Image
from meshreel.rendering.rasterizer import CLAY, render
from meshreel.rendering.studio import GLOW
from meshreel.rendering.track_colors import FrameNumbers, TrackColors, TrackScale
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count, Progress, silent

HEAT_PERCENTILE = 99.5
"""The range of a heat map ends at a round number above this percentile of all values."""

TRACK_HEAT = "track"

HEAT_NAMES = (*HEATS, TRACK_HEAT)
"""Kinds of heat maps: errors of positions, or errors of the track."""

WHITE: Color = (255, 255, 255)


@dataclass(frozen=True)
class HeatRange:
    """The color range of a heat map, the same for all frames."""

    high: float
    """End of the range, a round number; it begins at 0."""
    largest: float
    """Largest of all values, which may exceed `high`."""
    frame: int
    """Frame of the largest value."""


Frame = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Scales:
    """Color ranges of the heat map and of the track; None without one."""

    heat: HeatRange | None = None
    track: TrackScale | None = None


NO_SCALES = Scales()


@dataclass(frozen=True, eq=False)
class MeshLook:
    """Faces, colors and shading that the frames of a segment share."""

    faces: Faces
    surface: Surface
    paint: tuple[npt.ArrayLike, float | Singles]
    """Colors and glow, as for `render`."""
    shading: RowNormals | None
    """Normals of a mesh with hard edges; None for a smooth mesh."""
    owners: Integers | None
    """Integer array of shape (P,), or None. Cells of the polygons of a volume mesh, drawn flat."""
    is_cut: bool
    """Whether some cells are hidden."""


@dataclass(frozen=True, eq=False)
class SceneFrame:
    """A frame of each sequence of a scene, the original first."""

    positions: list[Frame]
    """list of float arrays of shape (V, 3)."""
    looks: list[MeshLook]
    values: list[Values]
    """list of arrays of shape (N, C). Track values, NaN in a segment without the track; empty
    without a track.
    """
    field: Field | None
    """Error of the decoded positions; None without such a heat map."""
    shown: list[npt.NDArray[np.bool_] | None]
    """list of bool arrays of shape (M,). Whether to draw each triangle; None to draw all."""


class Scene:
    """A mesh to draw, alone or next to its original and the heat map of their difference.

    Parameters
    ----------
    original : FrameSource or MeshSequence, optional
        With the same number of frames.
    heat : str, optional
        One of `HEAT_NAMES`; needs the original. "distance" is that of vertices if all frames have
        the same vertices and triangles, else from decoded vertices to the original surface; the
        others need the same vertices and triangles.
    background : three integers
        sRGB in 0..255.
    track : TrackLook, optional
        Colors the mesh and the original by the track of this name.
    cut : Cut, optional
        Hides cells of volume meshes, so that the inside is visible.

    Raises
    ------
    InvalidInputError
        If the original has another number of frames, or is missing or has another mesh for a heat
        map that compares the same vertices, or the track is missing.
    """

    def __init__(
        self,
        sequence: MeshSequence,
        original: MeshSequence | None = None,
        heat: str | None = None,
        *,
        background: Color = WHITE,
        track: TrackLook | None = None,
        cut: Cut | None = None,
    ) -> None:
        if heat is not None and original is None:
            raise InvalidInputError(
                "a heat map shows the difference from an original; name it with ",
                Keyword("original"),
            )
        if heat not in (None, *HEAT_NAMES):
            raise InvalidInputError(f"heat must be one of {', '.join(HEAT_NAMES)}; got {heat!r}")
        if heat == TRACK_HEAT and track is None:
            raise InvalidInputError("a heat map of a track needs its name: add ", Keyword("track"))
        self.sequence: MeshSequence = sequence
        self.original: MeshSequence | None = original
        self.heat: str | None = heat
        self.background: Color = background
        self._sources = [sequence] if original is None else [original, sequence]
        self._difference = _mesh_difference(self._sources)
        if self._difference and heat not in (None, "distance"):
            raise InvalidInputError(
                f"{self._difference}; a heat map of {heat} compares the same vertices, that of "
                "distance compares any surfaces"
            )
        self._cut = cut
        # Frames are drawn in order: only the look of the last segment is needed again.
        self._looks = [lru_cache(1)(partial(_look_of, source, cut)) for source in self._sources]
        self._field = lru_cache(1)(self._field_of_segments)
        self.track: TrackColors | None = None
        if track is not None:
            tracks = [track_by_name(tracks_of_all(source), track.name) for source in self._sources]
            segments = [segment for source in self._sources for segment in source.segments]
            kinds = {}
            for segment in segments:
                if (one := segment.tracks.get(track.name)) is not None:
                    kinds[one.kind, one.domain, one.shape[2]] = one
            if len(kinds) > 1:
                texts = " and ".join(describe_track(one) for one in kinds.values())
                raise InvalidInputError(
                    f"track {track.name!r} is {texts}; only a track of one kind in all segments "
                    "can be drawn"
                )
            self.track = TrackColors(track, tracks[-1])
            if cut is not None and self.track.domain in (Domain.FACE, Domain.CORNER):
                raise InvalidInputError(
                    f"track {track.name!r} has values of each {self.track.domain} of the outer "
                    "surface, which a cut replaces; omit ",
                    Keyword("cut"),
                )

    @property
    def track_column(self) -> int:
        """The last column whose views are colored by the track."""
        return -1 if self.original is None else 1

    @property
    def titles(self) -> list[str]:
        """The title of each view; empty for a single mesh."""
        if self.original is None:
            return [""]
        suffix = f": {self.track.title}" if self.track is not None else ""
        heat = [self._heat_text.label] if self.heat else []
        return [f"original{suffix}", f"decoded{suffix}", *heat]

    @property
    def _heat_text(self) -> Heat:
        """Label and unit of the heat map."""
        if self.heat == TRACK_HEAT:
            assert self.track is not None  # checked in __init__
            unit = self.track.error_unit
            return Heat(f"error of {self.track.name}{f', {unit}' if unit else ''}", unit)
        return SURFACE_HEAT if self._difference else HEATS[self.heat or "distance"]

    @property
    def heat_unit(self) -> str:
        """The unit of the heat map; may be empty."""
        return self._heat_text.unit if self.heat else ""

    @property
    def framed_sequence(self) -> MeshSequence:
        """The sequence that determines the camera: the original if there is one."""
        return self.original if self.original is not None else self.sequence

    def frames(self, numbers: Sequence[int]) -> "SelectedFrames":
        """Return the positions that the camera frames: with a cut, those of the visible cells."""
        faces_of = None if self._cut is None else lambda segment: self._looks[0](segment).faces
        return SelectedFrames(self.framed_sequence, numbers, faces_of)

    def read(self, number: int) -> SceneFrame:
        """Read a frame of each sequence."""
        pairs = [segment_of_frame(source.starts, number) for source in self._sources]
        looks = [look(index) for look, (index, _) in zip(self._looks, pairs, strict=True)]
        values: list[Values] = []
        shown: list[npt.NDArray[np.bool_] | None] = []
        for source, look, (index, local) in zip(self._sources, looks, pairs, strict=True):
            segment = source.segments[index]
            if self.track is not None:
                values.append(self._values(self.track, segment, local))
            shown.append(None if look.is_cut else _shown_triangles(segment, local))
        positions = [source[number].vertices for source in self._sources]
        has_field = self.heat not in (None, TRACK_HEAT)
        field = self._field(pairs[0][0], pairs[-1][0]) if has_field else None
        return SceneFrame(positions, looks, values, field, shown)

    @staticmethod
    def _values(track: TrackColors, segment: FrameSource, local: int) -> Values:
        """Values of the track in a frame of a segment; NaN if the segment lacks it."""
        if track.name in segment.tracks:
            return np.asarray(segment.tracks[track.name].read(local, local + 1)[0])
        n_items = segment.surface.n_items(track.domain, segment.n_verts, len(segment.faces))
        return np.full((n_items, track.n_columns), np.nan, np.float32)

    def _field_of_segments(self, original: int, decoded: int) -> Field:
        """Return the error field of frames in a segment of the original and one of the decoded."""
        assert self.heat is not None
        extent, segment = self._sources[0].extent, self._sources[0].segments[original]
        reference = reference_of_box(extent.low, extent.high)
        if self._difference:
            faces_hat = self._sources[-1].segments[decoded].faces
            return partial(
                surface_distance_percent,
                faces=segment.faces, faces_hat=faces_hat, reference=reference,
            )  # fmt: skip
        return heat_field(self.heat, segment.faces, segment.n_verts, reference.diagonal)

    def scales(self, numbers: Sequence[int], progress: Progress = silent) -> Scales:
        """Return color ranges that suit these frames, of which there must be at least one."""
        if self.heat is None and self.track is None:
            return NO_SCALES
        track_numbers, heat_numbers, maxima = FrameNumbers(), FrameNumbers(), []
        for n_done, number in enumerate(numbers, 1):
            moment = self.read(number)
            if self.track is not None and not self.track.shows_colors:
                for values in moment.values:
                    track_numbers.add(self.track.numbers(values))
            if self.heat is not None:
                heat = self._heat(moment)
                heat_numbers.add(heat)
                maxima.append(float(np.max(heat, initial=0.0, where=~np.isnan(heat))))
            progress("measuring", Count(n_done, len(numbers), "frames"))
        heat_range = None
        if self.heat is not None:
            worst = int(np.argmax(maxima))
            high = round_up(heat_numbers.percentile(HEAT_PERCENTILE))
            heat_range = HeatRange(high, maxima[worst], numbers[worst])
        return Scales(heat_range, None if self.track is None else self.track.scale(track_numbers))

    def draw(self, moment: SceneFrame, camera: Camera, scales: Scales = NO_SCALES) -> list[Image]:
        """Draw the views of a frame, in the order of their titles.

        Parameters
        ----------
        moment : Moment
            From `read`.
        scales : Scales, optional
            From `scales`.
        """
        paints = [look.paint for look in moment.looks]
        if self.track is not None:
            paints = []
            for values, look in zip(moment.values, moment.looks, strict=True):
                colors = self.track.colors(values, scales.track)
                paints.append((self._drawable_colors(self.track, colors, look), GLOW))
        views = [*zip(moment.positions, moment.looks, moment.shown, paints, strict=True)]
        if scales.heat is not None:
            heat, look = colorize(self._heat(moment), 0.0, scales.heat.high), moment.looks[-1]
            if self.track is not None and self.heat == TRACK_HEAT:
                heat = self._drawable_colors(self.track, heat, look)
            views.append((moment.positions[-1], look, moment.shown[-1], (heat, GLOW)))
        return [
            render(
                frame, look.faces, camera,
                colors=view_colors, background=self.background, glow=glow, shading=look.shading,
                shown=shown, smooth=look.owners is None,
            )
            for frame, look, shown, (view_colors, glow) in views
        ]  # fmt: skip

    def _heat(self, moment: SceneFrame) -> npt.NDArray[np.float64]:
        """Error of each vertex, or of each value of the track."""
        if moment.field is not None:
            return moment.field(*moment.positions)
        assert self.track is not None  # checked in __init__
        return self.track.errors(*moment.values)

    @staticmethod
    def _drawable_colors(track: TrackColors, colors: Image, look: MeshLook) -> Image:
        domain = track.domain
        if domain is Domain.CELL:
            colors, domain = colors[look.owners], Domain.FACE
        return colors_of_items(colors, domain, look.surface, look.faces)


def _mesh_difference(sources: Sequence[MeshSequence]) -> str:
    """Return how the meshes of an original and a decoded sequence differ, "" if they do not.

    Raises
    ------
    InvalidInputError
        If the number of frames differs, or the meshes are the same and tracks of equal names have
        different kinds.
    """
    if len(sources) < 2:
        return ""
    original, decoded = sources
    if original.n_frames != decoded.n_frames:
        raise InvalidInputError(
            f"the original has {counted(original.n_frames, 'frame')} and the decoded "
            f"{decoded.n_frames}; only sequences with equal numbers of frames can be compared"
        )
    if original.starts != decoded.starts:
        return "the faces change in different frames"
    pairs = list(zip(original.segments, decoded.segments, strict=True))
    if difference := next(filter(None, (mesh_difference(*pair) for pair in pairs)), ""):
        return difference
    for pair in pairs:
        require_comparable(*pair)
    return ""


def _look_of(source: MeshSequence, cut: Cut | None, number: int) -> MeshLook:
    """Return the look of a segment."""
    segment = source.segments[number]
    faces, surface = segment.faces, segment.surface
    owners: Integers | None = None
    if cut is not None:
        faces, surface, owners = cut_open(segment, cut)
    elif surface.cells is not None:
        owners = surface.cells.surface(segment.n_verts).owners.astype(np.int64)
    paint, shading = surface_paint(surface, faces), None
    if surface.hard_edges is not None:
        shading = RowNormals.of_surface(faces, surface, segment.n_verts)
    return MeshLook(faces, surface, paint, shading, owners, cut is not None)


def _shown_triangles(segment: FrameSource, number: int) -> npt.NDArray[np.bool_] | None:
    """Return the triangles of a frame that no track in `FACE_MASKS` hides; None without one."""
    tracks = [segment.tracks[name] for name in FACE_MASKS if name in segment.tracks]
    masks = [track for track in tracks if (track.domain, track.shape[2]) == (Domain.FACE, 1)]
    if not masks:
        return None
    is_face_shown = np.all([mask.read(number, number + 1)[0, :, 0] != 0 for mask in masks], axis=0)
    return np.repeat(is_face_shown, segment.surface.sizes(len(segment.faces)) - 2)


@dataclass(frozen=True, eq=False)
class SelectedFrames:
    """Positions of selected frames, read during iteration."""

    source: MeshSequence
    numbers: Sequence[int]
    faces_of: Callable[[int], Faces] | None = None
    """Returns the faces of a segment whose vertices are included. Default: all vertices are."""

    def __iter__(self) -> Iterator[Frame]:
        return (frame for frame, _ in self._read())

    def with_centers(self) -> Iterator[tuple[Frame, Floats]]:
        """Yield the positions and the center of each frame: the point that a camera follows.

        It is the mean vertex. If the mesh changes, it is the centroid of the surface, which does
        not jump where another triangulation begins.
        """
        is_constant = self.source.n_segments == 1
        for frame, faces in self._read():
            center = frame.mean(axis=0, dtype=np.float64) if is_constant else centroid(frame, faces)
            yield frame, center

    def _read(self) -> Iterator[tuple[Frame, Faces]]:
        for number in self.numbers:
            frame, faces = self.source[number]
            if self.faces_of is not None:
                drawn_faces = self.faces_of(segment_of_frame(self.source.starts, number)[0])
                vertices, corners = np.unique(drawn_faces, return_inverse=True)
                frame, faces = frame[vertices], corners.reshape(-1, 3).astype(np.int32)
            yield frame, faces


def centroid(vertices: Frame, faces: Faces) -> Floats:
    """Center of mass of a surface, shape (3,); the mean vertex of one without area."""
    middle = vertices.mean(axis=0, dtype=np.float64)
    corners = vertices[faces] - middle
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    total = areas.sum()
    offset = areas @ corners.mean(axis=1) / total if total > 0 else 0.0
    return np.asarray(middle + offset)


def surface_paint(surface: Surface, faces: Faces) -> tuple[npt.ArrayLike, float | Singles]:
    """The colors of a mesh, of its attribute and its materials, and the unlit share of each face.

    Faces without either, and those with an image, which pictures do not show, are gray.
    """
    colors = surface_colors(surface, faces)
    by_name = {material.name: material for material in surface.materials}
    groups = next((groups for groups in surface.groups if groups.name == "material"), None)
    if groups is None or not by_name:
        return CLAY if colors is None else colors, 0.0
    materials = [by_name.get(label) for label in (*groups.labels, "")]
    factors = np.array([(one or DEFAULT_MATERIAL).base_color[:3] for one in materials])
    if colors is None:
        is_clay = [one is None or one.base_color_texture is not None for one in materials]
        factors[is_clay] *= to_linear(np.array([CLAY], np.uint8))
    numbers = np.repeat(groups.numbers, surface.sizes(len(faces)) - 2)
    light = factors[numbers].repeat(3, axis=0)
    if colors is not None:
        of_corners = colors[faces] if colors.ndim == 2 else colors
        light *= to_linear(of_corners.reshape(-1, 3) / 255)
    rgb = (255 * to_srgb(light.clip(0, 1))).clip(0, 255).astype(np.float32)
    unlit = np.array([one is not None and one.unlit for one in materials], np.float32)
    return rgb.reshape(-1, 3, 3), unlit[numbers]


def surface_colors(surface: Surface, faces: Faces) -> npt.NDArray[np.float32] | None:
    """The first color attribute of a mesh, sRGB in 0..255; None without one.

    Parameters
    ----------
    surface : Surface
        Integer colors are used unchanged, others times 255; opacity is ignored.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    float32 array of shape (V, 3), per vertex, or (M, 3, 3), per corner of each face
    """
    attributes = surface.of_kind(Kind.COLOR)
    if not attributes:
        return None
    attribute = attributes[0]
    values = attribute.per_item()[:, :3].astype(np.float32)
    if values.shape[1] < 3:
        values = np.repeat(values[:, :1], 3, axis=1)  # shades of gray
    if attribute.values.dtype.kind == "f":
        values = 255 * np.nan_to_num(values)
    values = np.clip(values, 0, 255)
    return np.asarray(colors_of_items(values, attribute.domain, surface, faces))


def colors_of_items(
    colors: npt.NDArray[Any], domain: Domain, surface: Surface, faces: Faces
) -> npt.NDArray[Any]:
    """Convert colors of polygons or their corners to corners of triangles.

    Parameters
    ----------
    colors : array of shape (N, 3)
    domain : Domain
        Items that the colors belong to; vertex colors are returned unchanged.
    surface : Surface
        Defines the polygons.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    array of shape (V, 3) or (M, 3, 3)
    """
    if domain is Domain.VERTEX:
        return colors
    sizes = surface.sizes(len(faces))
    if domain is Domain.CORNER:
        return np.asarray(colors[triangle_corners(sizes, faces)])
    triangle_colors = np.repeat(colors, sizes - 2, axis=0)
    return np.repeat(triangle_colors[:, np.newaxis], 3, axis=1)
