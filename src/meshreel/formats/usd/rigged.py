"""Writing USD: a skinned mesh, its skeleton with an animation, and blend shapes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.kinds import VERTEX_FACE_CORNER, SequenceFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.rigs import is_rigged
from meshreel.formats.scenes.parts import unique_name
from meshreel.formats.usd.reading import read_meshes
from meshreel.formats.usd.writing import (
    Codes,
    MeshWriter,
    begin_stage,
    parts_of,
    usd_array,
    usd_time,
    write_frames,
    write_stage,
    write_time_codes,
)
from meshreel.model.notes import note_unwritten_tracks
from meshreel.model.rig import BYTE, FULL, MAX_INFLUENCES, Rig
from meshreel.runtime.extras import USD


def write_usd(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a sequence to a USD file, with a rig if the options request one.

    Raises
    ------
    FormatError
        If USD cannot write the file.
    InvalidInputError
        If a position does not fit into float32, or `max_error` has no effect.
    """
    if is_rigged(options):
        write_stage(path, stream, _write_rig)
    elif options.max_error is None:
        write_stage(path, stream, write_frames)
    else:
        raise InvalidInputError(
            Keyword("max_error"),
            " is a bound of rigs in USD, which otherwise stores exact frames; add ",
            Keyword("rig"),
            ", or omit it",
        )


def _write_rig(
    path: Path, stream: SegmentedStream, shared: SharedData, *, is_package: bool
) -> None:
    skel = USD.load("UsdSkel")
    stage = USD.load("Usd").Stage.CreateNew(str(path))
    codes = write_time_codes(stage, stream)
    assert stream.rig is not None  # see `save_part`
    rig, segment = stream.rig.rig, next(stream.meshes())
    note_unwritten_tracks(list(segment.tracks), "a rig", stream.notes)
    segment = replace(segment, tracks={})
    if segment.surface.hard_edges is not None:
        stream.notes.unwritten("left out hard edges: programs compute the normals of a rig")
    parts = parts_of(segment)
    paths, names, materials = begin_stage(
        stage, stream, segment, parts, rig.origin, is_package=is_package
    )
    root = "/" + paths[0].split("/")[1]
    skel.Root.Define(stage, root)
    skeleton = f"{root}/{unique_name('skeleton', names)}"
    _write_skeleton(stage, skeleton, rig)
    points = (rig.rest - rig.origin).astype(np.float32)
    shapes = [f"corrective_{number + 1}" for number in range(rig.n_targets)]
    _write_animation(stage, f"{skeleton}/animation", rig, codes, shapes)
    for part, mesh_path in zip(parts, paths, strict=True):
        mesh = MeshWriter(stage, mesh_path, has_normals=False)
        mesh.begin(part, segment, [None], materials, None)
        mesh.write_frame(points, {}, None)
        _bind(stage, mesh_path, skeleton, rig, part.verts, shapes)
    materials.note_unused()
    stage.GetRootLayer().Save()


def joint_paths(rig: Rig) -> list[str]:
    """Return the paths of the joints: names from the root, as UsdSkel has them."""
    paths: list[str] = []
    for name, parent in zip(rig.skeleton.names, rig.skeleton.parents.tolist(), strict=True):
        paths.append(name if parent < 0 else f"{paths[parent]}/{name}")
    return paths


def _write_skeleton(stage: Any, path: str, rig: Rig) -> None:
    skel, parents, joints = USD.load("UsdSkel"), rig.skeleton.parents, rig.skeleton.joints
    parent_joints = np.where(parents[:, np.newaxis] < 0, 0.0, joints[parents])
    skeleton = skel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(joint_paths(rig))
    skeleton.CreateBindTransformsAttr(_translations(joints))
    skeleton.CreateRestTransformsAttr(_translations(joints - parent_joints))
    binding = skel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([f"{path}/animation"])


def _translations(offsets: npt.NDArray[np.float64]) -> Any:
    """Return the matrices of translations, whose last row is the offset in USD."""
    matrices = np.tile(np.eye(4), (len(offsets), 1, 1))
    matrices[:, 3, :3] = offsets
    return USD.load("Vt").Matrix4dArray.FromNumpy(matrices)


def _write_animation(stage: Any, path: str, rig: Rig, codes: Codes, shapes: list[str]) -> None:
    """Write the poses of all frames, since all joints of USD have the same samples."""
    vt = USD.load("Vt")
    animation = USD.load("UsdSkel").Animation.Define(stage, path)
    animation.CreateJointsAttr(joint_paths(rig))
    animation.CreateScalesAttr(vt.Vec3hArray(rig.n_bones, USD.load("Gf").Vec3h(1, 1, 1)))
    poses = [track.poses(rig.times_s) for track in rig.tracks]
    quaternions = np.stack([rotation for rotation, _ in poses], axis=1)
    translations = np.stack([translation for _, translation in poses], axis=1)
    rotations, offsets = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    weights = None
    if shapes:
        animation.CreateBlendShapesAttr(shapes)
        weights = animation.CreateBlendShapeWeightsAttr()
    for frame, code in enumerate(codes):
        time = usd_time(code)
        rotations.Set(vt.QuatfArray.FromNumpy(quaternions[frame].astype(np.float32)), time)
        offsets.Set(usd_array("float3", translations[frame]), time)
        if weights is not None:
            weights.Set(usd_array("float", rig.correctives.weights[frame]), time)


def _bind(stage: Any, path: str, skeleton: str, rig: Rig, verts: slice, shapes: list[str]) -> None:
    """Bind a mesh to the skeleton, and write its blend shapes."""
    skel = USD.load("UsdSkel")
    binding = skel.BindingAPI.Apply(stage.GetPrimAtPath(path))
    binding.CreateSkeletonRel().SetTargets([skeleton])
    indices = binding.CreateJointIndicesPrimvar(False, MAX_INFLUENCES)
    indices.Set(usd_array("int", rig.joints[verts]))
    weights = rig.weights[verts] / np.float32(FULL)
    binding.CreateJointWeightsPrimvar(False, MAX_INFLUENCES).Set(usd_array("float", weights))
    binding.CreateGeomBindTransformAttr(USD.load("Gf").Matrix4d(1.0))
    if not shapes:
        return
    displacements = rig.correctives.targets[:, verts] * np.float32(rig.scale / BYTE)
    targets = []
    for name, offsets in zip(shapes, displacements, strict=True):
        shape = skel.BlendShape.Define(stage, f"{path}/{name}")
        moved_points = np.flatnonzero(offsets.any(axis=1))
        shape.CreateOffsetsAttr(usd_array("float3", offsets[moved_points]))
        shape.CreatePointIndicesAttr(usd_array("int", moved_points))
        targets.append(shape.GetPath())
    binding.CreateBlendShapesAttr(shapes)
    binding.CreateBlendShapeTargetsRel().SetTargets(targets)


TITLES = {
    ".usd": "USD",
    ".usda": "USD, text",
    ".usdc": "USD, binary",
    ".usdz": "USD, package",
}

FORMATS = tuple(
    SequenceFormat(
        extension,
        title,
        read_meshes=read_meshes,
        extra=USD,
        write=write_usd,
        holds_segments=True,
        write_options=frozenset({"rig", "kg", "quality", "max_error"}),
        refers_to_files=True,
        holds_materials=True,
        has_image_folder=extension != ".usdz",
        track_domains=VERTEX_FACE_CORNER,
    )
    for extension, title in TITLES.items()
)
