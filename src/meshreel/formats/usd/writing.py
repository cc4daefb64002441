"""Writing a sequence as a USD file: one mesh per part, with one sample of points per frame.

Frames are written to a binary file (crate) first and saved whenever `UNSAVED_BYTES` are in memory;
text files and packages are made from that file.
"""

import re
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.frames.segmented_stream import SegmentedStream
from meshreel.formats.frames.shared_data import SharedData, sharing_materials
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.surfaces.images import image_names
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.layers import DEFAULT_RATE
from meshreel.formats.usd.material_writing import Materials, TextureWriter
from meshreel.formats.usd.mesh_writing import MeshWriter, uv_primvars, write_surface
from meshreel.formats.usd.prim_names import mesh_paths
from meshreel.formats.usd.sampling import snap
from meshreel.formats.usd.track_writing import TrackWriter, track_writers
from meshreel.model.extent import Corners
from meshreel.model.materials import Image
from meshreel.model.tracks import TrackKind
from meshreel.runtime.extras import USD

UNSAVED_BYTES = 1 << 25
PACKAGE_FOLDER = "textures"
"""Folder of the images in a package."""

NOT_PORTABLE = r"[^A-Za-z0-9_-]"
"""Characters to replace in names of files in packages."""


def write_usd(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a sequence to a USD file, in the format that its extension selects.

    If the faces change, faces, primvars and subsets are sampled.

    Positions are float32, as in USD. If float64 positions are so far from the origin that this
    would move them, they are written relative to a nearby point, with a float64 transform.

    Raises
    ------
    FormatError
        If USD cannot write the file.
    """
    is_package = path.suffix.lower() == ".usdz"
    stream, shared = sharing_materials(stream)
    shared.note_others(path.suffix.lower(), stream.notes)
    stream = stream.changed(shared.only)
    with (
        # A failure to remove temporary files is harmless.
        tempfile.TemporaryDirectory(dir=path.parent, ignore_cleanup_errors=True) as folder,
        usd_errors(f"USD cannot write {path.name}"),
    ):
        binary = Path(folder) / f"{re.sub(NOT_PORTABLE, '_', stream.name) or 'mesh'}.usdc"
        if is_package:
            _write_images(Path(folder) / PACKAGE_FOLDER, next(stream.meshes()).surface.images)
        _write_binary(binary, stream, shared, is_package=is_package)
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


def _write_images(folder: Path, images: Sequence[Image]) -> None:
    """Write the images of a package, which are added to it together with the stage."""
    if images:
        folder.mkdir()
    for name, image in zip(image_names(images), images, strict=True):
        (folder / name).write_bytes(image.data)


def _write_binary(
    path: Path, stream: SegmentedStream, shared: SharedData, *, is_package: bool
) -> None:
    stage = USD.load("Usd").Stage.CreateNew(str(path))
    codes = _write_time_codes(stage, stream)
    scene: _SceneWriter | None = None
    n_unsaved, is_rounded = 0, False
    for segment, (start, stop) in zip(stream.segments(), pairwise(stream.starts), strict=True):
        if scene is None:
            folder = PACKAGE_FOLDER if is_package else stream.image_folder
            changing = shared if stream.n_segments > 1 else None
            scene = _SceneWriter(stage, segment, folder, changing, is_package=is_package)
        scene.begin(segment, codes[start:stop])
        tracks = [track for mesh in scene.meshes for track in track_writers(mesh, segment)]
        origin = scene.origin
        n_unsaved += segment.faces.nbytes + segment.surface.size_bytes
        frames = zip(codes[start:stop], segment.frames(), strict=True)
        for index, (code, frame) in enumerate(frames):
            local = frame - origin if origin.any() else frame
            single = local.astype(np.float32, copy=False)
            is_rounded = is_rounded or not np.array_equal(single, local)
            for mesh in scene.meshes:
                mesh.write_points(single, code)
            n_unsaved += single.nbytes + _write_tracks(tracks, segment, index, code)
            if n_unsaved > UNSAVED_BYTES:
                stage.GetRootLayer().Save()
                n_unsaved = 0
    assert scene is not None  # there is at least one segment
    scene.materials.note_unused()
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


def _write_time_codes(stage: Any, stream: SegmentedStream) -> list[float | None]:
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


class _SceneWriter:
    """The meshes of a stage, with everything but points and tracks.

    Parameters
    ----------
    first : FrameStream
        The first segment.
    folder : str
        Folder of the images next to the file or in the package.
    changing : SharedData, optional
        Data of all segments, if there are several.

    Attributes
    ----------
    origin : float64 array of shape (3,)
        The point to which positions are relative.
    meshes : list of MeshWriter
    materials : Materials
    """

    def __init__(
        self,
        stage: Any,
        first: FrameStream,
        folder: str,
        changing: SharedData | None,
        *,
        is_package: bool,
    ) -> None:
        geometry = USD.load("UsdGeom")
        self._changing = changing
        self.origin = _origin(first)
        images = first.surface.images
        textures = TextureWriter(
            stage,
            images,
            [f"./{folder}/{name}" for name in image_names(images)],
            uv_primvars(first.surface),
            is_package=is_package,
        )
        geometry.SetStageUpAxis(stage, geometry.Tokens.y)
        geometry.SetStageMetersPerUnit(stage, 1.0)
        parts = _parts(first)
        paths = mesh_paths([part.name for part in parts], first.name or "scene")
        root = "/" + paths[0].split("/")[1]
        transform = geometry.Xform.Define(stage, root)
        stage.SetDefaultPrim(transform.GetPrim())
        if self.origin.any():
            operation = transform.AddTranslateOp(geometry.XformOp.PrecisionDouble)
            operation.Set(tuple(self.origin.tolist()))
        names, looks = {path.split("/")[2] for path in paths}, first.surface.materials
        self.materials = Materials(stage, root, names, looks, textures, first.notes)
        has_track = any(one.kind is TrackKind.NORMAL for one in first.tracks.values())
        self.meshes = []
        for part, path in zip(parts, paths, strict=True):
            has_hard_edges = part.surface.hard_edges is not None
            if changing is not None:
                has_hard_edges = changing.has_hard_edges
            mesh = MeshWriter(stage, path, part, has_normals=has_hard_edges and not has_track)
            self.meshes.append(mesh)

    def begin(self, segment: FrameStream, codes: Sequence[float | None]) -> None:
        """Write faces, attributes and groups of a segment.

        Parameters
        ----------
        codes : sequence of float or None
            Time codes of its frames.
        """
        labels = None if self._changing is None else self._changing.labels
        when: Sequence[float | None] = [None]
        if labels is not None:
            when = codes if len(codes) == 1 else [codes[0], codes[-1]]
        for mesh, part in zip(self.meshes, _parts(segment), strict=True):
            mesh.begin(part, when[0])
            write_surface(
                mesh.prim, part.surface, len(part.counts), self.materials, segment.notes,
                when, labels,
            )  # fmt: skip


def _parts(stream: FrameStream) -> list[PartMesh]:
    """Return the parts of a mesh that have faces; notes of the stream name the others."""
    found = []
    for part in split_parts(stream.faces, stream.surface, stream.n_verts, stream.name or "mesh"):
        if len(part.counts):
            found.append(part)
        else:
            note = f"part {part.name} is left out, since it is empty"
            stream.notes.extend([note] if note not in stream.notes else [])
    return found
