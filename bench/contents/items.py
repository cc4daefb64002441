"""Items of files and sequences, and the law that each is kept or named."""

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.model.materials import Material
from meshreel.model.sequence import FrameSource, MeshSequence
from meshreel.model.surface import Kind
from meshreel.model.tracks import TrackKind, is_color

TOLERANCE = 1e-5
"""Allowed difference of values, relative to the largest one: single precision, after sums."""

COLOR_TOLERANCE = 0.6 / 255
"""Allowed difference of colors, which some formats store as bytes."""


class Sort(StrEnum):
    """Sorts of items; items of different sorts never match."""

    POSITIONS = "positions"
    """Vertices, with all their coordinates where no transform moves them."""
    FACES = "faces"
    """Faces or cells; `values` is their number."""
    DATA = "data"
    """Tracks and attributes of vertices, faces, corners or cells."""
    COLOR = "color"
    """Colors, whose names differ between formats, in sRGB 0..1."""
    UV = "uv"
    """Texture coordinates, whose names differ between formats."""
    GROUP = "group"
    """A labeled set of faces: a group, a part, or the faces of a material."""
    MATERIAL = "material"
    """A property of a material, named "material.property" with the property of `Material`."""
    IMAGE = "image"
    """An image; `values` is its size in bytes."""
    TIMES = "times"
    """Times of the frames in seconds."""
    EDGES = "hard edges"
    """Hard edges, from which normals follow."""
    VISIBILITY = "visibility"
    """Meshes that are hidden in some frames; they begin segments."""
    UNIT = "unit"
    """The unit of a track."""
    OTHER = "other"
    """What no sequence holds, such as cameras: it must be named."""


NAMELESS = {
    Sort.POSITIONS, Sort.FACES, Sort.COLOR, Sort.UV, Sort.IMAGE, Sort.TIMES, Sort.EDGES,
    Sort.VISIBILITY,
}  # fmt: skip
"""Sorts whose items match under any name."""


@dataclass(frozen=True, eq=False)
class Item:
    """A value that a file or a sequence holds."""

    sort: Sort
    name: str
    """Name in the file, possibly a path of which the last part counts."""
    values: npt.ArrayLike | None = None
    """All its numbers, with components on the last axis; None if only the name is compared."""
    words: tuple[str, ...] = ()
    """Words by which a note may name it, such as "cameras"; its name always counts."""

    @property
    def leaf(self) -> str:
        """The last part of the name, in lower case."""
        return re.split(r"[/:]", self.name)[-1].strip().lower() or self.name.lower()

    def matches(self, other: "Item") -> bool:
        """Return whether another item holds the same value."""
        is_named_alike = self.sort in NAMELESS or self.leaf == other.leaf
        return self.sort is other.sort and is_named_alike and self._is_held_by(other)

    def _is_held_by(self, other: "Item") -> bool:
        """Return whether the values, and rows of components, are among those of another item."""
        if self.values is None or other.values is None:
            return True
        ours, theirs = (np.asarray(values, np.float64) for values in (self.values, other.values))
        numbers = finite(ours), finite(theirs)
        scale = max(1e-30, *(abs(end) for both in numbers for end in (*both[:1], *both[-1:])))
        allowed = COLOR_TOLERANCE if self.sort is Sort.COLOR else TOLERANCE * scale
        if not are_among(*numbers, allowed):
            return False
        if min(ours.ndim, theirs.ndim) < 2 or ours.shape[-1] != theirs.shape[-1]:
            return True
        weights = np.sqrt(np.arange(ours.shape[-1]) + 2)  # tell exchanged components apart
        rows = finite(ours @ weights), finite(theirs @ weights)
        return are_among(*rows, allowed * weights.sum())

    def is_named_in(self, notes: Iterable[str], listed: Collection[str] = ()) -> bool:
        """Return whether a note contains its name or one of its words, as whole words.

        `listed` are names of the notes in lower case, which are found faster.
        """
        names = [name for name in {self.name, self.leaf, *self.words} if name]
        if any(name.lower() in listed for name in names):
            return True
        pattern = "|".join(rf"(?<!\w){re.escape(name)}(?!\w)" for name in names)
        texts = (" ".join([note, *getattr(note, "names", ())]) for note in notes)
        return any(re.search(pattern, text, re.IGNORECASE) for text in texts)


def valued(
    name: str, values: Any, kind: str = "", unit: str = "", words: tuple[str, ...] = ()
) -> Iterator[Item]:
    """Yield the item of named values, by their kind, and that of their unit if they have one."""
    sort = {"color": Sort.COLOR, "uv": Sort.UV}.get(kind, Sort.DATA)
    yield Item(sort, name, values, words)
    if unit:
        yield Item(Sort.UNIT, f"{name}:{unit}", words=("units", name))


def timed(times: Sequence[float] | Floats) -> Iterator[Item]:
    """Yield the times of frames in seconds, unless there is one frame at time 0."""
    if len(times) > 1 or (len(times) and times[0]):
        yield Item(Sort.TIMES, "times", times, ("frame rate", "frame times", "start"))


def finite(values: Floats) -> Floats:
    """Return the finite numbers in ascending order."""
    numbers: Floats = np.sort(values[np.isfinite(values)])
    return numbers


def are_among(ours: Floats, theirs: Floats, allowed: float) -> bool:
    """Return whether ascending numbers are among others with the same range.

    If they are as many, each number must occur as often.
    """
    if not len(ours) or not len(theirs):
        return not len(ours)
    if len(ours) == len(theirs):
        return bool((abs(ours - theirs) <= allowed).all())
    after = np.searchsorted(theirs, ours).clip(max=len(theirs) - 1)
    nearest = np.minimum(abs(ours - theirs[after]), abs(ours - theirs[after - (after > 0)]))
    is_wider = max(ours[0] - theirs[0], theirs[-1] - ours[-1]) > allowed
    return bool((nearest <= allowed).all()) and not is_wider


def merged(items: Iterable[Item]) -> Iterator[Item]:
    """Yield an item for all of a sort and name, as of several frames, with all their values."""
    groups: dict[tuple[Sort, str], list[Item]] = defaultdict(list)
    for item in items:
        groups[item.sort, item.name].append(item)
    for (sort, name), same in groups.items():
        values = [np.asarray(item.values) for item in same if item.values is not None]
        is_known = len(values) == len(same) and (sort is not Sort.FACES or len(same) == 1)
        if len({array.shape[1:] for array in values}) > 1:
            values = [array.ravel() for array in values]
        joined = np.concatenate([*map(np.atleast_1d, values)]) if is_known else None
        yield Item(sort, name, joined, same[0].words)


@dataclass(frozen=True)
class Balance:
    """How many items of an input are in an output, and which are neither there nor named."""

    listed: int
    kept: int
    named: int
    silent: tuple[str, ...]
    """As "data temperature"."""


def balance(items: Collection[Item], others: Collection[Item], notes: Collection[str]) -> Balance:
    """Compare the items of a file with those of the sequence read from it, or the reverse.

    Parameters
    ----------
    items, others : collections of Item
        Of the input and of the output.
    notes : collection of str
        What reading or writing said.
    """
    missing = [item for item in items if not any(map(item.matches, others))]
    listed = {name.lower() for note in notes for name in getattr(note, "names", ())}
    unnamed = [item for item in missing if not item.is_named_in(notes, listed)]
    silent = [f"{item.sort} {item.name}" for item in unnamed]
    named = len(missing) - len(silent)
    return Balance(len(items), len(items) - len(missing), named, tuple(silent))


DEFAULTS = Material("")


def items_of(sequence: MeshSequence) -> Iterator[Item]:
    """Yield what a sequence holds."""
    times = sequence.timing.seconds(sequence.n_frames)
    yield from timed(() if times is None else times)
    if sequence.n_segments > 1:
        yield Item(Sort.VISIBILITY, "segments")
    items = [item for segment in sequence.segments for item in _items_of(segment)]
    yield from items if sequence.n_segments == 1 else merged(items)


def _items_of(segment: FrameSource) -> Iterator[Item]:
    surface, n_faces = segment.surface, len(segment.faces)
    positions = segment.read(0, segment.n_frames)
    yield Item(Sort.POSITIONS, "positions", positions.reshape(-1, 3))
    yield Item(Sort.FACES, "faces", surface.n_faces(n_faces))
    if surface.cells is not None:
        yield Item(Sort.FACES, "cells", surface.cells.n_cells)
    for name, track in segment.tracks.items():
        values = track.read(0, segment.n_frames)
        values = values.reshape(-1, values.shape[-1])
        is_plain = track.kind is TrackKind.COLOR and not is_color(track.kind, track.dtype)
        values = _colors(values) if is_color(track.kind, track.dtype) else values
        yield from valued(name, values, "" if is_plain else track.kind.value, track.unit)
    for attribute in surface.attributes:
        values = attribute.per_item()
        values = _colors(values) if attribute.kind is Kind.COLOR else values
        yield from valued(attribute.name, values, attribute.kind.value)
    for groups in surface.groups:
        for label in groups.labels:
            yield Item(Sort.GROUP, label, words=(f"groups {groups.name!r}",))
    for part in surface.parts:
        yield Item(Sort.GROUP, part.name, words=("parts",))
    for material in surface.materials:
        yield from _items_of_material(material)
    for image in surface.images:
        yield Item(
            Sort.IMAGE, image.name or "image", len(image.data), ("texture image", "texture images")
        )
    if surface.hard_edges is not None:
        yield Item(Sort.EDGES, "hard edges", words=("hard edge",))


def _items_of_material(material: Material) -> Iterator[Item]:
    """Yield the properties that differ from the defaults; textures by their slots."""
    words = ("material properties", "materials", material.name)
    for field in fields(Material):
        value = getattr(material, field.name)
        if field.name != "name" and value != getattr(DEFAULTS, field.name):
            is_number = isinstance(value, (bool, int, float, tuple))
            name = f"{material.name}.{field.name}"
            yield Item(Sort.MATERIAL, name, value if is_number else None, words)


def _colors(values: npt.NDArray[Any]) -> Floats:
    """Return colors as fractions of white."""
    colors: Floats = values / (np.iinfo(values.dtype).max if values.dtype.kind in "ui" else 1.0)
    return colors
