"""Several meshes as one of several parts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.scenes.attribute_domains import in_one_domain
from meshreel.formats.scenes.merged_materials import shared_look
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.surface import Attribute, Domain, FaceGroups, Part, Surface


def merged_mesh(meshes: Sequence[SceneMesh], name: str, notes: list[str]) -> SceneMesh:
    """All meshes as one, whose parts have their names.

    Its frames are those of the mesh that has most of them within the time that any of them
    covers. A mesh that has no frame at such a time is between two of its own there, on a straight
    line, and before its first or behind its last stays as it is.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    name : str
        Of the whole.
    notes : list of str
        Gains a sentence for each attribute that only some of the meshes have.
    """
    times = united_times([mesh.times_s for mesh in meshes])

    def frame(index: int) -> PolygonMesh:
        return _joined([_at(mesh, times[index]) for mesh in meshes])

    def surface(index: int) -> Surface:
        numbers = [int(np.searchsorted(mesh.times_s, times[index], "right")) - 1 for mesh in meshes]
        numbers = [max(0, number) for number in numbers]
        frames = [mesh.frame(number) for mesh, number in zip(meshes, numbers, strict=True)]
        surfaces = [mesh.surface(number) for mesh, number in zip(meshes, numbers, strict=True)]
        parts = tuple(
            Part(mesh.name, len(frame.vertices), len(frame.counts))
            for mesh, frame in zip(meshes, frames, strict=True)
        )
        surfaces, materials, images = shared_look(surfaces)
        attributes = _merged_attributes(in_one_domain(surfaces, frames), frames, notes)
        groups = _merged_groups(surfaces, frames)
        return Surface(None, attributes, groups, parts, materials, images)

    rates = {mesh.fps for mesh in meshes if mesh.fps}
    return SceneMesh(name, times, frame, surface, rates.pop() if len(rates) == 1 else None)


def united_times(times: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """All the times at which something changes, ascending; of what does not move, the first.

    Each is those of one thing, ascending; times that differ by less than a thousandth of the
    shortest step are one.
    """
    moving = [one for one in times if len(one) > 1]
    if not moving:
        return np.asarray(times[0][:1], np.float64)
    every = np.sort(np.concatenate(moving))
    least = min(float(np.diff(one).min()) for one in moving) / 1000
    distinct: npt.NDArray[np.float64] = every[np.diff(every, prepend=-np.inf) > least]
    return distinct


def _at(mesh: SceneMesh, time_s: float) -> PolygonMesh:
    times = mesh.times_s
    after = int(np.searchsorted(times, time_s))
    if after == 0 or after == len(times):
        return mesh.frame(min(after, len(times) - 1))
    before, step = after - 1, times[after] - times[after - 1]
    share = float((time_s - times[before]) / step)
    if share > 0.999:
        return mesh.frame(after)
    first = mesh.frame(before)
    if share < 0.001:
        return first
    second = mesh.frame(after)
    if second.difference(first):
        return first
    blend = (1 - share) * first.vertices.astype(np.float64) + share * second.vertices
    vertices: Any = blend.astype(first.vertices.dtype)
    return PolygonMesh(vertices, first.counts, first.corners)


def _joined(frames: Sequence[PolygonMesh]) -> PolygonMesh:
    starts = np.cumsum([0] + [len(frame.vertices) for frame in frames])
    corners = [frame.corners + start for frame, start in zip(frames, starts, strict=False)]
    return PolygonMesh(
        np.concatenate([frame.vertices for frame in frames]),
        np.concatenate([frame.counts for frame in frames]),
        np.concatenate(corners).astype(np.int32),
    )


def _n_items(frame: PolygonMesh, domain: Domain) -> int:
    return {
        Domain.VERTEX: len(frame.vertices),
        Domain.FACE: len(frame.counts),
        Domain.CORNER: len(frame.corners),
    }[domain]


def _merged_attributes(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh], notes: list[str]
) -> tuple[Attribute, ...]:
    """Attributes of the same kind, name, domain and width as one; zeros where a mesh has none."""
    keys = {_key(one): one for surface in surfaces for one in surface.attributes}
    merged = []
    for key, sample in keys.items():
        own = [
            next((one for one in surface.attributes if _key(one) == key), None)
            for surface in surfaces
        ]
        if any(one is None for one in own):
            note = f"{sample.kind} {sample.name!r} is 0 where a mesh has none of its own"
            if note not in notes:
                notes.append(note)
        dtype = np.result_type(*(one.values.dtype for one in own if one is not None))
        merged.append(_concatenated(sample, own, frames, dtype))
    return tuple(merged)


def _key(attribute: Attribute) -> tuple[str, str, str, int, bool]:
    width, is_byte = attribute.values.shape[1], attribute.values.dtype.kind in "iu"
    return attribute.kind, attribute.name, attribute.domain, width, is_byte


def _concatenated(
    sample: Attribute,
    own: Sequence[Attribute | None],
    frames: Sequence[PolygonMesh],
    dtype: np.dtype[np.generic],
) -> Attribute:
    width, start = sample.values.shape[1], 0
    is_indexed = any(one is not None and one.indices is not None for one in own)
    values, indices = [], []
    for one, frame in zip(own, frames, strict=True):
        n_items = _n_items(frame, sample.domain)
        if one is None:
            # Without indices every item needs its row; with them, all share a single one.
            table = np.zeros((1 if is_indexed else n_items, width), dtype)
            rows = np.zeros(n_items, np.int32)
        else:
            table = one.values.astype(dtype, copy=False)
            rows = np.arange(n_items, dtype=np.int32) if one.indices is None else one.indices
        values.append(table)
        indices.append(rows + np.int32(start))
        start += len(table)
    joined = np.concatenate(indices).astype(np.int32) if is_indexed else None
    return Attribute(sample.name, sample.kind, sample.domain, np.concatenate(values), joined)


def _merged_groups(
    surfaces: Sequence[Surface], frames: Sequence[PolygonMesh]
) -> tuple[FaceGroups, ...]:
    names = dict.fromkeys(groups.name for surface in surfaces for groups in surface.groups)
    merged = []
    for name in names:
        labels: dict[str, int] = {}
        numbers = []
        for surface, frame in zip(surfaces, frames, strict=True):
            own = next((one for one in surface.groups if one.name == name), None)
            if own is None:
                numbers.append(np.full(len(frame.counts), -1, np.int32))
                continue
            new = [labels.setdefault(label, len(labels)) for label in own.labels]
            numbers.append(np.array([*new, -1], np.int32)[own.numbers])
        merged.append(FaceGroups(name, tuple(labels), np.concatenate(numbers)))
    return tuple(merged)
