"""Reading USD files: every mesh, in world space, with its animation.

Files are read through ``Usd.Stage``, which composes references, layers, instances and value clips.
Points are read at their samples; meshes that move between keys of transforms or skeletons are read
at every frame of the stage. Skinning and blend shapes are evaluated by UsdSkel. Positions keep the
units and axes of the file.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh, Visibility, read_or_defer_error
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.usd.materials import StageMaterials
from meshreel.formats.usd.meshes import StageMesh, Transforms, ancestors, find_skins
from meshreel.formats.usd.sampling import (
    TOLERANCE,
    Samples,
    attribute_codes,
    even_interval,
    frame_grid,
    snap,
)
from meshreel.formats.usd.stage import codes_per_frame, codes_per_second, open_stage, usd_errors
from meshreel.formats.usd.unread import CONTAINERS, StageContents
from meshreel.model.notes import NoteKind
from meshreel.model.validation import validate_fps
from meshreel.runtime.extras import USD

RESAMPLED = "frames differ from samples; USD interpolates at each frame"
BLURRED = "samples between frames, as for motion blur"
FINAL_POSE = "the last frame shows the final pose, which is earlier"
"""Subjects of notes, which list meshes."""


def read_meshes(path: Path, reading: Reading) -> list[SceneMesh]:
    """Return the meshes of a USD file.

    With a frame rate in the options, if any mesh moves between its samples, all meshes are sampled
    at that rate, from the first sample of the file to the last.

    Raises
    ------
    FormatError
        If USD cannot read the file, or it contains no mesh.
    """
    stage = open_stage(path, reading)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage.GetRootLayer())
        contents = StageContents(stage, reading.notes)
        mesh_prims = readable_prims(contents.prims)
        skins, transforms = find_skins(mesh_prims), Transforms()
        materials = StageMaterials(None if reading.allow_outside else path.parent, contents)
        normals = NormalNotes(reading.notes)
        meshes = [
            StageMesh(
                contents, prim, transforms, skins.get(str(prim.GetPath())), materials, normals
            )
            for prim in mesh_prims
        ]
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        shown = [mesh for mesh in meshes if _visibility(mesh.prim, rate).is_shown.any()] or meshes
        used = [*mesh_prims, *(prim for skin in skins.values() for prim in skin.prims)]
        read = meshes if reading.object else shown
        used += (prim for mesh in read for prim in materials.bound_to(mesh.prim))
        contents.note_others(used)
        codes_of, grid = _frame_codes(shown, rate, codes_per_frame(stage, rate), reading)

    def scene_mesh(mesh: StageMesh) -> SceneMesh:
        with usd_errors(f"USD cannot read {mesh.path}"):
            whole = _scene_mesh(mesh, codes_of(mesh), rate, has_rate=has_rate)
            visibility = _visibility(mesh.prim, rate, grid)
            return replace(whole, visibility=visibility, note_unread=contents.note_unread)

    return [read_or_defer_error(mesh.path, partial(scene_mesh, mesh)) for mesh in meshes]


def _scene_mesh(mesh: StageMesh, codes: Floats, rate: float, *, has_rate: bool) -> SceneMesh:
    fps = None
    if not mesh.samples.are_frames and (interval := even_interval(codes)):
        fps = rate / interval
    elif len(codes) == 1 and has_rate and len(mesh.samples.all):
        fps = rate
    codes = codes if len(codes) else np.zeros(1)
    animated = cache(lambda: mesh.animated(codes))
    return SceneMesh(
        mesh.path,
        (codes if mesh.samples.are_frames else snap(codes)) / rate,
        lambda index: mesh.frame(float(codes[index])),
        lambda index: mesh.surface(float(codes[index]), animated()),
        fps,
        lambda frames: mesh.tracks(codes, frames, animated()),
    )


def _frame_codes(
    meshes: Sequence[StageMesh], rate: float, frame_interval: float, reading: Reading
) -> tuple[Callable[[StageMesh], Floats], Floats | None]:
    """Return a function that gives the time codes of the frames of a mesh, empty if static.

    Also return the time codes that all animated meshes have in common, or None.
    """
    samples: list[Samples] = []
    for mesh in meshes:
        with suppress(FormatError):  # raised again when the mesh is read
            _ = mesh.samples.all
            samples.append(mesh.samples)
    interpolated = [
        sample.all for sample in samples if sample.moves_between_samples(frame_interval)
    ]
    if (fps := validate_fps(reading.fps or 0.0)) and interpolated:
        animated = [sample.all for sample in samples if len(sample.all) > 1]
        first = min(float(codes[0]) for codes in animated)
        last = max(float(codes[-1]) for codes in animated)
        grid = frame_grid(first, last, rate / fps)

        def common_codes(mesh: StageMesh) -> Floats:
            if len(mesh.samples.all) < 2:
                return mesh.samples.all
            _note_final_pose(
                mesh, grid, max(float(sample.all[-1]) for sample in samples if len(sample.all))
            )
            return grid

        return common_codes, grid
    origin = min((float(codes[0]) for codes in interpolated), default=0.0)

    def codes_of(mesh: StageMesh) -> Floats:
        codes = mesh.samples.frames(frame_interval, origin)
        n_samples = len(mesh.samples.all)
        if len(codes) < n_samples and np.isin(codes, mesh.samples.all).all():
            name = f"{mesh.path} ({n_samples - len(codes)} of {n_samples})"
            mesh.contents.notes.left_out(BLURRED, [name])
        elif len(codes) != n_samples:
            name = f"{mesh.path} ({n_samples} samples, {len(codes)} frames)"
            mesh.contents.notes.list_names(NoteKind.CHANGED, RESAMPLED, [name])
        if n_samples:
            _note_final_pose(mesh, codes, float(mesh.samples.all[-1]))
        return codes

    return codes_of, None


def _note_final_pose(mesh: StageMesh, codes: Floats, last: float) -> None:
    """Note a mesh whose last sample is between two frames; the later frame shows it."""
    if codes[-1] > last + TOLERANCE:
        name = f"{mesh.path} (time code {last:g}, shown at {codes[-1]:g})"
        mesh.contents.notes.list_names(NoteKind.CHANGED, FINAL_POSE, [name])


def readable_prims(prims: Sequence[Any]) -> list[Any]:
    """Return the prims that are meshes with points and faces.

    Raises
    ------
    FormatError
        If there are none, listing the contents.
    """
    schema = USD.load("UsdGeom").Mesh
    readable = [
        prim
        for prim, mesh in zip(prims, map(schema, prims), strict=True)
        if mesh and prim.IsActive() and prim.IsDefined()
        if mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()
    ]
    if not readable:
        kinds = Counter(str(prim.GetTypeName()) for prim in prims)
        counts = (f"{kinds[kind]} {kind}" for kind in kinds if kind not in CONTAINERS)
        contents = ", ".join(counts)
        raise FormatError(f"contains no mesh, only {contents}" if contents else "contains no mesh")
    return readable


def _visibility(prim: Any, rate: float, codes: Floats | None = None) -> Visibility:
    """Return when a mesh is rendered: while it is visible, if its purpose is default or render.

    Parameters
    ----------
    codes : float64 array, optional
        Time codes at which visibility is evaluated; default: those of its samples.
    """
    geometry = USD.load("UsdGeom")
    mesh = geometry.Imageable(prim)
    purpose, inherited = mesh.ComputePurpose(), geometry.Tokens.inherited
    if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
        return Visibility(np.zeros(1), np.zeros(1, np.bool_), f"purpose {purpose}")
    samples = set[float]()
    for above in ancestors(prim):
        if imageable := geometry.Imageable(above):
            samples |= {*attribute_codes(imageable.GetVisibilityAttr())}
    times = np.array(sorted(samples) or [0.0]) if codes is None or not samples else codes
    shown = [mesh.ComputeVisibility(code) == inherited for code in times.tolist()]
    return Visibility(snap(times) / rate, np.array(shown))
