"""Writing a sequence as a USD file: one mesh per part, with one sample of points per frame.

Frames are written to a binary file (crate) first and saved whenever `UNSAVED_BYTES` are in memory;
text files and packages are made from that file.
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import split_parts
from meshreel.formats.surfaces.images import image_names
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.layers import DEFAULT_RATE
from meshreel.formats.usd.material_writing import Materials
from meshreel.formats.usd.mesh_writing import MeshWriter, uv_primvars, write_surface
from meshreel.formats.usd.prim_names import mesh_paths
from meshreel.formats.usd.sampling import snap
from meshreel.formats.usd.texture_writing import TextureWriter
from meshreel.formats.usd.track_writing import TrackWriter, track_writers
from meshreel.model.sequence import Corners
from meshreel.model.tracks import TrackKind

UNSAVED_BYTES = 1 << 25
PACKAGE_FOLDER = "textures"
"""Folder of the images in a package."""

NOT_PORTABLE = r"[^A-Za-z0-9_-]"
"""Characters to replace in names of files in packages."""


def write_usd(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a sequence to a USD file, in the format that its extension selects.

    Positions are float32, as in USD. If float64 positions are so far from the origin that this
    would move them, they are written relative to a nearby point, with a float64 transform.

    Raises
    ------
    FormatError
        If USD cannot write the file.
    """
    is_package = path.suffix.lower() == ".usdz"
    with (
        # A failure to remove temporary files is harmless.
        tempfile.TemporaryDirectory(dir=path.parent, ignore_cleanup_errors=True) as folder,
        usd_errors(f"USD cannot write {path.name}"),
    ):
        binary = Path(folder) / f"{re.sub(NOT_PORTABLE, '_', stream.name) or 'mesh'}.usdc"
        if is_package:
            _write_images(Path(folder) / PACKAGE_FOLDER, stream)
        _write_binary(binary, stream, is_package=is_package)
        if is_package:
            asset = USD.load("Sdf").AssetPath(str(binary))
            is_written = USD.load("UsdUtils").CreateNewUsdzPackage(asset, str(path))
        elif path.suffix.lower() == ".usda":
            is_written = USD.load("Sdf").Layer.FindOrOpen(str(binary)).Export(str(path))
        else:
            binary.replace(path)
            is_written = True
        if not is_written:
            raise FormatError(f"USD cannot write {path.name}, and gives no reason")


def _write_images(folder: Path, stream: FrameStream) -> None:
    """Write the images of a package, which are added to it together with the stage."""
    if stream.surface.images:
        folder.mkdir()
    for name, image in zip(image_names(images := stream.surface.images), images, strict=True):
        (folder / name).write_bytes(image.data)


def _write_binary(path: Path, stream: FrameStream, *, is_package: bool) -> None:
    stage = USD.load("Usd").Stage.CreateNew(str(path))
    codes = _write_time_codes(stage, stream)
    origin = _origin(stream)
    images = stream.surface.images
    folder = PACKAGE_FOLDER if is_package else stream.image_folder
    textures = TextureWriter(
        stage,
        images,
        [f"./{folder}/{name}" for name in image_names(images)],
        uv_primvars(stream.surface),
        is_package=is_package,
    )
    meshes = _write_meshes(stage, stream, origin, textures)
    tracks = [track for mesh in meshes for track in track_writers(mesh, stream)]
    n_unsaved, is_rounded = 0, False
    for index, (code, frame) in enumerate(zip(codes, stream.frames(), strict=True)):
        local = frame - origin if origin.any() else frame
        single = local.astype(np.float32, copy=False)
        is_rounded = is_rounded or not np.array_equal(single, local)
        for mesh in meshes:
            mesh.write_points(single, code)
        n_unsaved += single.nbytes + _write_tracks(tracks, stream, index, code)
        if n_unsaved > UNSAVED_BYTES:
            stage.GetRootLayer().Save()
            n_unsaved = 0
    stage.GetRootLayer().Save()
    if is_rounded:
        stream.notes.append("positions are rounded to float32, as USD stores them")


def _write_tracks(
    tracks: Sequence[TrackWriter], stream: FrameStream, index: int, code: float | None
) -> int:
    """Write the track values of a frame, and return their size in bytes."""
    values = stream.values(index)
    for one in tracks:
        one.write(values[one.name], code)
    return sum(one.nbytes for one in values.values())


def _write_time_codes(stage: Any, stream: FrameStream) -> list[float | None]:
    """Write the rate and range of the stage, and return the time code of each frame, if any."""
    if stream.n_frames == 1 and not (stream.fps or stream.start_s):
        return [None]
    rate = stream.fps or DEFAULT_RATE
    if not stream.fps:
        stream.notes.append(f"the frame rate is unknown; written as {rate:g} frames per second")
    codes = (float(snap(np.array(stream.start_s * rate))) + np.arange(stream.n_frames)).tolist()
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(codes[0])
    stage.SetEndTimeCode(codes[-1])
    return list(codes)


def _origin(stream: FrameStream) -> Corners:
    """Return the point to which positions are relative, of shape (3,): 0 if float32 suffices."""
    narrowing = Narrowing()
    narrowing.add(stream.first)
    if narrowing.is_harmless:
        return np.zeros(3)
    origin: Corners = np.round(stream.first.astype(np.float64).mean(axis=0))
    stream.notes.append(
        f"positions are far from the origin; written relative to {origin.tolist()}, with a "
        "transform"
    )
    return origin


def _write_meshes(
    stage: Any, stream: FrameStream, origin: Corners, textures: TextureWriter
) -> list[MeshWriter]:
    """Write the prims of the meshes with everything but points and tracks."""
    geometry = USD.load("UsdGeom")
    geometry.SetStageUpAxis(stage, geometry.Tokens.y)
    geometry.SetStageMetersPerUnit(stage, 1.0)
    split = split_parts(stream.faces, stream.surface, stream.n_verts, stream.name or "mesh")
    parts = []
    for part in split:
        if len(part.counts):
            parts.append(part)
        else:
            stream.notes.append(f"part {part.name} is left out, since it is empty")
    paths = mesh_paths([part.name for part in parts], stream.name or "scene")
    root = "/" + paths[0].split("/")[1]
    transform = geometry.Xform.Define(stage, root)
    stage.SetDefaultPrim(transform.GetPrim())
    if origin.any():
        transform.AddTranslateOp(geometry.XformOp.PrecisionDouble).Set(tuple(origin.tolist()))
    names, looks = {path.split("/")[2] for path in paths}, stream.surface.materials
    materials = Materials(stage, root, names, looks, textures, stream.notes)
    meshes = []
    has_track = any(one.kind is TrackKind.NORMAL for one in stream.tracks.values())
    for part, path in zip(parts, paths, strict=True):
        has_normals = part.surface.hard_edges is not None and not has_track
        mesh = MeshWriter(stage, path, part, has_normals=has_normals)
        write_surface(mesh.prim, part.surface, len(part.counts), materials, stream.notes)
        meshes.append(mesh)
    materials.note_unused()
    return meshes
