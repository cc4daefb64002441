"""Reading USD files: every mesh that is rendered, in world space, with its animation.

Files are read through ``Usd.Stage``, which composes references, layers, instances and value clips.
Points are read at their samples; meshes that move between keys of transforms or skeletons are read
at every frame of the stage. Skinning and blend shapes are evaluated by UsdSkel. Positions keep the
units and axes of the file.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.surfaces.hard_edges import NormalNotes
from meshreel.formats.usd.materials import StageMaterials
from meshreel.formats.usd.meshes import StageMesh, Transforms, find_skins
from meshreel.formats.usd.sampling import (
    TOLERANCE,
    Samples,
    attribute_codes,
    even_interval,
    frame_grid,
    snap,
)
from meshreel.formats.usd.stage import codes_per_frame, codes_per_second, open_stage, usd_errors
from meshreel.model.notes import NoteKind, Notes
from meshreel.model.validation import validate_fps
from meshreel.runtime.extras import USD

RESAMPLED = "frames differ from samples; USD interpolates at each frame"
FINAL_POSE = "the last frame shows the final pose, which is earlier"
"""Subjects of notes, which list meshes."""

MAX_PRIMS = 1_000_000
"""Limit, since nested instances can make a small file expand to any number of prims."""


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """Return the meshes of a USD file.

    With a frame rate in the options, if any mesh moves between its samples, all meshes are sampled
    at that rate, from the first sample of the file to the last.

    Raises
    ------
    FormatError
        If USD cannot read the file, or it contains no mesh that is rendered.
    """
    stage = open_stage(path, options)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage.GetRootLayer())
        rendered = rendered_meshes(stage, options.notes)
        skins, transforms = find_skins(rendered), Transforms()
        materials = StageMaterials(None if options.allow_outside else path.parent, options.notes)
        notes, normals = options.notes, NormalNotes(options.notes)
        meshes = [
            StageMesh(
                stage, prim, transforms, skins.get(str(prim.GetPath())), materials, notes, normals
            )
            for prim in rendered
        ]
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        codes_of = _frame_codes(meshes, rate, codes_per_frame(stage, rate), options)

    def scene_mesh(mesh: StageMesh) -> SceneMesh:
        with usd_errors(f"USD cannot read {mesh.path}"):
            return _scene_mesh(mesh, codes_of(mesh), rate, has_rate=has_rate)

    return [read_or_defer_error(mesh.path, partial(scene_mesh, mesh)) for mesh in meshes]


def _scene_mesh(mesh: StageMesh, codes: Floats, rate: float, *, has_rate: bool) -> SceneMesh:
    fps = None
    if interval := even_interval(codes):
        fps = rate / interval
    elif len(codes) == 1 and has_rate and len(mesh.samples.all):
        fps = rate
    codes = codes if len(codes) else np.zeros(1)
    animated = cache(lambda: mesh.animated(codes))
    return SceneMesh(
        mesh.path,
        snap(codes) / rate,
        lambda index: mesh.frame(float(codes[index])),
        lambda index: mesh.surface(float(codes[index]), animated()),
        fps,
        lambda frames: mesh.tracks(codes, frames, animated()),
    )


def _frame_codes(
    meshes: Sequence[StageMesh], rate: float, frame_interval: float, options: ReadOptions
) -> Callable[[StageMesh], Floats]:
    """Return a function that gives the time codes of the frames of a mesh, empty if static."""
    samples: list[Samples] = []
    for mesh in meshes:
        with suppress(FormatError):  # raised again when the mesh is read
            _ = mesh.samples.all
            samples.append(mesh.samples)
    interpolated = [
        sample.all for sample in samples if sample.moves_between_samples(frame_interval)
    ]
    if (fps := validate_fps(options.fps or 0.0)) and interpolated:
        animated = [sample.all for sample in samples if len(sample.all) > 1]
        first = min(float(codes[0]) for codes in animated)
        last = max(float(codes[-1]) for codes in animated)
        grid = cache(lambda: frame_grid(first, last, rate / fps))

        def common_codes(mesh: StageMesh) -> Floats:
            if len(mesh.samples.all) < 2:
                return mesh.samples.all
            _note_final_pose(
                mesh, grid(), max(float(sample.all[-1]) for sample in samples if len(sample.all))
            )
            return grid()

        return common_codes
    origin = min((float(codes[0]) for codes in interpolated), default=0.0)

    def codes_of(mesh: StageMesh) -> Floats:
        codes = mesh.samples.frames(frame_interval, origin)
        if len(codes) != (n_samples := len(mesh.samples.all)):
            name = f"{mesh.path} ({n_samples} samples, {len(codes)} frames)"
            mesh.notes.list_names(NoteKind.CHANGED, RESAMPLED, [name])
        if n_samples:
            _note_final_pose(mesh, codes, float(mesh.samples.all[-1]))
        return codes

    return codes_of


def _note_final_pose(mesh: StageMesh, codes: Floats, last: float) -> None:
    """Note a mesh whose last sample is between two frames; the later frame shows it."""
    if codes[-1] > last + TOLERANCE:
        name = f"{mesh.path} (time code {last:g}, shown at {codes[-1]:g})"
        mesh.notes.list_names(NoteKind.CHANGED, FINAL_POSE, [name])


def rendered_meshes(stage: Any, notes: Notes) -> list[Any]:
    """Return the prims of the meshes that are rendered, in stage order.

    These are the meshes that are visible at some time, have the purpose default or render, and have
    points and faces.

    Parameters
    ----------
    notes : Notes
        Gains a sentence on meshes that are not rendered, and on other geometry.

    Raises
    ------
    FormatError
        If there are none, listing the contents; or if the stage has more than `MAX_PRIMS` prims.
    """
    meshes, other_counts = _geometry(stage)
    reasons = [_reason_not_rendered(mesh) for mesh in meshes]
    rendered = [mesh for mesh, reason in zip(meshes, reasons, strict=True) if not reason]
    hidden = Counter(reason for reason in reasons if reason)
    contents = ", ".join(
        [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
        + [f"{n} {kind}" for kind, n in other_counts.items()]
    )
    if not rendered:
        no_geometry = "contains no geometry"
        raise FormatError(f"contains no visible mesh, only {contents}" if contents else no_geometry)
    names = [str(mesh.GetPath()) for mesh in rendered if len(set(_visibility(mesh))) > 1]
    notes.left_out("visibility that changes over time", names)
    if contents:
        notes.left_out(contents)
    return rendered


def _geometry(stage: Any) -> tuple[list[Any], Counter[str]]:
    """Return the meshes of a stage, and counts of prims of other types, such as cameras.

    Prims below point instancers are skipped: they are rendered only as instances.
    """
    usd, geometry, lights = USD.load("Usd"), USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
    meshes, other_counts = list[Any](), Counter[str]()
    prims = iter(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    for number, prim in enumerate(prims):
        if number == MAX_PRIMS:
            raise FormatError(
                f"contains more than {MAX_PRIMS} prims; write the mesh to a separate file"
            )
        is_instancer = prim.IsA(geometry.PointInstancer)
        if prim.IsA(geometry.Mesh):
            meshes.append(prim)
        elif (
            is_instancer
            or prim.IsA(geometry.Gprim)
            or prim.IsA(geometry.Camera)
            or prim.HasAPI(lights)
        ):
            other_counts[prim.GetTypeName()] += 1
        if is_instancer:
            prims.PruneChildren()
    return meshes, other_counts


def _reason_not_rendered(prim: Any) -> str:
    """Return why a mesh is not rendered, in a few words; empty if it is."""
    geometry = USD.load("UsdGeom")
    purpose = geometry.Imageable(prim).ComputePurpose()
    if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
        return f"of purpose {purpose}"
    mesh = geometry.Mesh(prim)
    if not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    return "" if any(_visibility(prim)) else "invisible"


def _visibility(prim: Any) -> list[bool]:
    """Return the visibility of a mesh at each of its samples, or a single value without samples."""
    geometry, codes = USD.load("UsdGeom"), set[float]()
    mesh = geometry.Imageable(prim)
    while prim and not prim.IsPseudoRoot():
        if imageable := geometry.Imageable(prim):
            codes |= {*attribute_codes(imageable.GetVisibilityAttr())}
        prim = prim.GetParent()
    inherited = geometry.Tokens.inherited
    return [mesh.ComputeVisibility(code) == inherited for code in sorted(codes) or [0.0]]
