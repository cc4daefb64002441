"""Writing a sequence as a USD file: one mesh per part, with one sample of points per frame.

Frames are written to a binary file (crate) first and saved whenever `UNSAVED_BYTES` are in memory;
text files and packages are made from that file.
"""

import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Values
from meshreel.errors import FormatError
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import SharedData, share_materials
from meshreel.formats.scenes.parts import PartMesh, split_parts, unique_name
from meshreel.formats.scenes.transforms import Rounding
from meshreel.formats.surfaces.images import image_names
from meshreel.formats.usd.material_writing import Materials, prim_name, set_display_name
from meshreel.formats.usd.materials import MATERIALS
from meshreel.formats.usd.quantities import (
    COLOR,
    COMPUTED,
    IS_ATTRIBUTE,
    OPACITY,
    STANDARD_NAMES,
    TRACK_KIND,
    TRACK_NAME,
    UNIT,
    UVS,
)
from meshreel.formats.usd.sampling import ARE_FRAMES, snap
from meshreel.formats.usd.stage import usd_errors
from meshreel.model.colors import to_linear
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.notes import Notes, note_track_type, written_rate
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource, is_color
from meshreel.runtime.extras import USD

UNSAVED_BYTES = 1 << 25
PACKAGE_FOLDER = "textures"
"""Folder of the images in a package."""

NOT_PORTABLE = r"[^A-Za-z0-9_-]"
"""Characters to replace in names of files in packages."""

INTERPOLATIONS = {
    Domain.VERTEX: "vertex",
    Domain.FACE: "uniform",
    Domain.CORNER: "faceVarying",
}
ELEMENTS = {
    "u1": "uchar", "i1": "int", "u2": "int", "i2": "int", "i4": "int", "u4": "uint",
    "i8": "int64", "u8": "uint64", "f4": "float", "f8": "double",
}  # fmt: skip
"""USD's element type for each number type, without loss."""

VELOCITIES, NORMALS = "velocities", "normals"
NAMES_AND_TYPES: Mapping[str, tuple[str, str]] = {
    TrackKind.VECTOR: ("", "vector"),
    TrackKind.VELOCITY: (VELOCITIES, "vector"),
    TrackKind.NORMAL: (NORMALS, "normal"),
    TrackKind.COLOR: (COLOR, "color"),
    TrackKind.UV: (UVS, "texCoord"),
}
"""For each kind, the standard name, which programs use by default, and the type of floats."""

TYPES = "vector3", "normal3", "color3", "color4", "texCoord2"
"""USD's types of several floats, without their precision."""

NARROW_COLORS = "colors are rounded to float32"

Codes = Sequence[float | None]
"""Time codes of samples; None writes the default value, of a file without animation."""


def write_stage(path: Path, stream: SegmentedStream, write_binary: Callable[..., None]) -> None:
    """Write a USD file by a function that writes a binary one.

    Parameters
    ----------
    write_binary : function
        Called with the path of the binary file, the stream, the data that its segments share, and
        ``is_package``.

    Raises
    ------
    FormatError
        If USD cannot write the file.
    """
    is_package = path.suffix.lower() == ".usdz"
    stream, shared = share_materials(stream)
    shared.note_others(path.suffix.lower(), stream.notes)
    stream = stream.map_segments(shared.restrict)
    with (
        # A failure to remove temporary files is harmless.
        tempfile.TemporaryDirectory(dir=path.parent, ignore_cleanup_errors=True) as folder,
        usd_errors(f"USD cannot write {path.name}"),
    ):
        binary = Path(folder) / f"{re.sub(NOT_PORTABLE, '_', stream.name) or 'mesh'}.usdc"
        images = next(stream.meshes()).surface.images if is_package else ()
        for name, image in zip(image_names(images), images, strict=True):
            file = Path(folder) / PACKAGE_FOLDER / name  # added to the package with the stage
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(image.data)
        write_binary(binary, stream, shared, is_package=is_package)
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


def write_frames(
    path: Path, stream: SegmentedStream, shared: SharedData, *, is_package: bool
) -> None:
    """Write a binary file with the positions of all frames.

    If the faces change, faces, primvars and subsets are sampled.

    Positions are float32, as in USD. If float64 positions are so far from the origin that this
    would move them, they are written relative to a nearby point, with a float64 transform.
    """
    stage = USD.load("Usd").Stage.CreateNew(str(path))
    codes = write_time_codes(stage, stream)
    common = shared if stream.n_segments > 1 else None
    meshes: list[MeshWriter] = []
    rounding: Rounding | None = None
    n_unsaved = 0
    for segment, (start, stop) in zip(stream.segments(), pairwise(stream.starts), strict=True):
        parts, span = parts_of(segment), codes[start:stop]
        if rounding is None:
            rounding = Rounding(segment.first, "USD")
            paths, _, materials = begin_stage(
                stage, stream, segment, parts, rounding.shift, is_package=is_package
            )
            for part, mesh_path in zip(parts, paths, strict=True):
                has_normals = part.writes_edge_normals(segment.tracks, common)
                meshes.append(MeshWriter(stage, mesh_path, has_normals=has_normals))
        # Floats need a sample at the first and the last frame, since USD interpolates them.
        samples: Codes = [None] if common is None else list(dict.fromkeys([span[0], span[-1]]))
        for mesh, part in zip(meshes, parts, strict=True):
            mesh.begin(part, segment, samples, materials, common)
        n_unsaved += segment.faces.nbytes + segment.surface.size_bytes
        for index, frame in enumerate(segment.frames()):
            positions, values = rounding.add(frame), segment.values(index)
            for mesh in meshes:
                mesh.write_frame(positions, values, span[index])
            n_unsaved += positions.nbytes + sum(value.nbytes for value in values.values())
            if n_unsaved > UNSAVED_BYTES:
                stage.GetRootLayer().Save()
                n_unsaved = 0
    assert rounding is not None  # there is at least one segment
    materials.note_unused()
    stage.GetRootLayer().Save()
    rounding.note(stream.notes)


def write_time_codes(stage: Any, stream: SegmentedStream) -> Codes:
    """Write the rate and range of the stage, and return the time code of each frame, if any."""
    timing = stream.timing
    if stream.n_frames == 1 and not (timing.fps or timing.start_s):
        return [None]
    if timing.times is None:
        rate = written_rate(timing, stream.notes)
        codes = (float(snap(np.array(timing.start_s * rate))) + np.arange(stream.n_frames)).tolist()
    else:  # time codes are seconds
        rate, codes = 1.0, timing.times.tolist()
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(codes[0])
    stage.SetEndTimeCode(codes[-1])
    return list(codes)


def begin_stage(
    stage: Any,
    stream: SegmentedStream,
    first: FrameStream,
    parts: Sequence[PartMesh],
    shift: Floats,
    *,
    is_package: bool,
) -> tuple[list[str], set[str], Materials]:
    """Write the axes, units and root of a stage, which the shift, of shape (3,), translates.

    Return the paths of the parts of the first segment, the names of the prims below the root, and
    the writer of materials.
    """
    paths = mesh_paths([part.name for part in parts], first.name or "scene")
    geometry, root = USD.load("UsdGeom"), "/" + paths[0].split("/")[1]
    geometry.SetStageUpAxis(stage, geometry.Tokens.y)
    geometry.SetStageMetersPerUnit(stage, 1.0)
    transform = geometry.Xform.Define(stage, root)
    stage.SetDefaultPrim(transform.GetPrim())
    if stream.timing.times is not None:
        transform.GetPrim().SetCustomDataByKey(ARE_FRAMES, True)
    if shift.any():
        operation = transform.AddTranslateOp(geometry.XformOp.PrecisionDouble)
        operation.Set(tuple(shift.tolist()))
    surface, names = first.surface, {path.split("/")[2] for path in paths}
    folder = PACKAGE_FOLDER if is_package else stream.image_folder
    files = [f"./{folder}/{name}" for name in image_names(surface.images)]
    primvars = {
        attribute.name: name
        for attribute, name in reversed(primvar_names(surface))
        if attribute.kind is Kind.UV
    }
    images = list(zip(surface.images, files, strict=True))
    materials = Materials(
        stage, root, names, surface.materials, images, primvars, first.notes, is_package=is_package
    )
    return paths, names, materials


def parts_of(stream: FrameStream) -> list[PartMesh]:
    """Return the parts of a mesh that have faces; notes of the stream name the others."""
    parts = []
    for part in split_parts(stream.faces, stream.surface, stream.n_verts, stream.name or "mesh"):
        if len(part.counts):
            parts.append(part)
        else:
            stream.notes.unwritten(part.name, f"part {part.name} is left out, since it is empty")
    return parts


def mesh_paths(names: Sequence[str], root: str) -> list[str]:
    """Return the paths of the meshes of a file, in order, all below one prim.

    That prim is the first element of all names, if they share it, and otherwise `root`. No mesh is
    at or below the path of another.

    Parameters
    ----------
    names : sequence of str
        Paths such as "/root/body", or plain names.

    Returns
    -------
    list of str
        Paths such as "/root/body", with at least two elements.
    """
    cleaned = [
        tuple(prim_name(element) for element in name.split("/") if element) or (prim_name(""),)
        for name in names
    ]
    if len({elements[0] for elements in cleaned}) > 1 or min(map(len, cleaned)) < 2:
        cleaned = [(prim_name(root), *elements) for elements in cleaned]
    ancestors = {elements[:n] for elements in cleaned for n in range(1, len(elements))}
    used = {"/" + "/".join(ancestor) for ancestor in ancestors}
    paths = []
    for elements in cleaned:
        while elements in ancestors:  # meshes must not be below meshes
            elements = (*elements, elements[-1])
        paths.append(unique_name("/" + "/".join(elements), used))
    return paths


def primvar_names(surface: Surface) -> list[tuple[Attribute, str]]:
    """Return attributes with their unique primvar names.

    The first UVs are called ``st`` and the first colors ``displayColor``, unless other attributes
    have these names.
    """
    names = {id(attribute): prim_name(attribute.name) for attribute in surface.attributes}
    for kind, standard in STANDARD_NAMES.items():
        named = surface.of_kind(kind)
        if named and standard not in names.values():
            names[id(named[0])] = standard
    used: set[str] = set()
    return [
        (attribute, unique_name(names[id(attribute)], used)) for attribute in surface.attributes
    ]


class MeshWriter:
    """Writes a mesh at a path of a stage: faces and attributes per segment, points per frame.

    Parameters
    ----------
    has_normals : bool
        Whether to write normals computed from hard edges.
    """

    def __init__(self, stage: Any, path: str, *, has_normals: bool) -> None:
        geometry = USD.load("UsdGeom")
        for parent in list(USD.load("Sdf").Path(path).GetParentPath().GetPrefixes()):
            if not stage.GetPrimAtPath(parent):
                geometry.Xform.Define(stage, parent)
        self._mesh = geometry.Mesh.Define(stage, path)
        self._mesh.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
        self._api = geometry.PrimvarsAPI(self._mesh.GetPrim())
        self._points, self._extent = self._mesh.CreatePointsAttr(), self._mesh.CreateExtentAttr()
        self._shading: RowNormals | None = None
        self._normals: Any = None
        if has_normals:
            normals = USD.load("Sdf").ValueTypeNames.Normal3fArray
            self._normals = self._api.CreatePrimvar("normals", normals, "faceVarying")
            self._normals.GetAttr().SetCustomDataByKey(COMPUTED, True)

    def begin(
        self,
        part: PartMesh,
        segment: FrameStream,
        codes: Codes,
        materials: Materials,
        common: SharedData | None,
    ) -> None:
        """Write the faces, attributes and groups of a segment, and prepare its tracks.

        Parameters
        ----------
        segment : FrameStream
            Its notes gain a sentence where USD stores another number type.
        codes : sequence of float or None
            Time codes of the samples.
        common : SharedData, optional
            Data of all segments, if there are several.
        """
        self._part, time = part, usd_time(codes[0])
        self._mesh.CreateFaceVertexCountsAttr().Set(usd_array("int", part.counts), time)
        self._mesh.CreateFaceVertexIndicesAttr().Set(usd_array("int", part.corners), time)
        if self._normals is not None:
            self._shading = part.edge_normals()
            self._normals.SetIndices(usd_array("int", self._shading.rows.of_corner), time)
        for attribute, name in primvar_names(part.surface):
            self._write_attribute(attribute, name, codes, segment.notes)
        self._write_groups(part.surface.groups, materials, codes[0], common)
        names = {name for _, name in primvar_names(part.surface)}
        names |= {OPACITY} if COLOR in names else set()
        self._tracks = [
            writer
            for name, track in segment.tracks.items()
            for writer in self._track_writers(name, track, names, segment.notes)
        ]

    def write_frame(
        self, frame: npt.NDArray[np.float32], values: dict[str, Values], code: float | None
    ) -> None:
        """Write points of a frame, their extent, normals if the mesh has them, and tracks.

        Parameters
        ----------
        frame : float32 array of shape (V, 3)
            Positions of all vertices of the sequence.
        values : dict of str to array of shape (N, C)
            Values of the tracks for all meshes of the sequence.
        """
        points, time = frame[self._part.verts], usd_time(code)
        self._points.Set(usd_array("float3", points), time)
        extent = np.stack([points.min(axis=0), points.max(axis=0)])
        self._extent.Set(usd_array("float3", extent), time)
        if self._shading is not None:
            normals = self._shading.of_frames(points[np.newaxis])[0]
            self._normals.Set(usd_array("float3", normals), time)
        for name, items, columns, type_name, has_colors, attribute in self._tracks:
            rows = values[name][items]
            rows = to_linear(rows) if has_colors else rows
            attribute.Set(usd_array(type_name, rows[:, columns]), time)

    def _write_attribute(self, attribute: Attribute, name: str, codes: Codes, notes: Notes) -> None:
        values, indices = attribute.values, attribute.indices
        is_color = attribute.kind is Kind.COLOR
        if is_color:
            if values.dtype == np.float64:
                notes.changed(NARROW_COLORS)
            values = to_linear(values).astype(np.float32)
        interpolation, is_single = INTERPOLATIONS[attribute.domain], codes[0] is None
        is_vertex_color = is_color and attribute.domain is Domain.VERTEX
        if is_vertex_color and indices is not None and len(values) == 1 and is_single:
            interpolation, indices = "constant", None  # other segments may have several colors
        for written_name, columns in _columns(name, values.shape[1]):
            components = values[:, columns]
            type_name = _type_name(attribute.kind, written_name, values.dtype, components.shape[1])
            primvar = self._primvar(written_name, type_name, interpolation, components.shape[1])
            if not is_single:
                primvar.GetAttr().SetCustomDataByKey(IS_ATTRIBUTE, True)
            for code in codes:
                primvar.Set(usd_array(type_name, components), usd_time(code))
            if indices is not None:
                primvar.SetIndices(usd_array("int", indices), usd_time(codes[0]))

    def _primvar(self, name: str, type_name: str, interpolation: str, n_columns: int) -> Any:
        value_type = USD.load("Sdf").ValueTypeNames.Find(f"{type_name}[]")
        width = n_columns if type_name in ELEMENTS.values() else 1
        return self._api.CreatePrimvar(name, value_type, interpolation, width)

    def _track_writers(
        self, name: str, track: TrackSource, used: set[str], notes: Notes
    ) -> Iterator[tuple[str, slice, slice, str, bool, Any]]:
        """Yield name, items, columns, type, whether to convert colors, and attribute of a track.

        The first vertex velocities and normals become those of the mesh; the first colors are
        called ``displayColor`` and the first UVs ``st``, unless attributes have these names.
        """
        has_colors = is_color(track.kind, track.dtype)
        is_number = track.kind is TrackKind.COLOR and not has_colors  # of an unknown range
        standard_name, _ = ("", "") if is_number else NAMES_AND_TYPES.get(track.kind, ("", ""))
        is_possible = standard_name != VELOCITIES or track.domain is Domain.VERTEX
        has_opacity = standard_name == COLOR and OPACITY in used
        if standard_name and is_possible and standard_name not in used and not has_opacity:
            used.add(written_name := standard_name)
        else:  # programs would misinterpret other tracks with standard names
            reserved = used | {OPACITY, *(name for name, _ in NAMES_AND_TYPES.values())}
            used.add(written_name := unique_name(prim_name(name), reserved))
        for primvar_name, columns in _columns(written_name, track.shape[2]):
            used.add(primvar_name)
            n_columns = len(range(track.shape[2])[columns])
            type_name = _type_name(track.kind, primvar_name, track.dtype, n_columns)
            if primvar_name == written_name:
                note_track_type(name, track.dtype, _array_type(type_name)[1], notes)
            interpolation = INTERPOLATIONS[track.domain]
            if primvar_name == VELOCITIES:
                attribute = self._mesh.CreateVelocitiesAttr()
            elif primvar_name == NORMALS:
                self._mesh.SetNormalsInterpolation(interpolation)
                attribute = self._mesh.CreateNormalsAttr()
            else:
                primvar = self._primvar(primvar_name, type_name, interpolation, n_columns)
                attribute = primvar.GetAttr()
            entries = {TRACK_KIND: str(track.kind), TRACK_NAME: name, UNIT: track.unit}
            for key, text in entries.items():
                if text:
                    attribute.SetCustomDataByKey(key, text.encode("utf-8", "replace").decode())
            yield name, self._part.items[track.domain], columns, type_name, has_colors, attribute

    def _write_groups(
        self,
        groups: Sequence[FaceGroups],
        materials: Materials,
        code: float | None,
        common: SharedData | None,
    ) -> None:
        """Write groups as subsets; a material of all faces is bound to the mesh."""
        prim, used = self._mesh.GetPrim(), set[str]()
        for group in groups:
            if common is not None:
                labels = common.labels[(group.name,)]
                order = [*map(labels.index, group.labels), -1]
                group = FaceGroups(group.name, labels, np.array(order, np.int32)[group.numbers])
            if group.name == "material":
                materials.write_double_sided(prim, group)
                if len(group.labels) == 1 and (group.numbers == 0).all() and common is None:
                    materials.bind(prim, group.labels[0])
                    continue
            self._write_subsets(group, materials, used, code)

    def _write_subsets(
        self, groups: FaceGroups, materials: Materials, used: set[str], code: float | None
    ) -> None:
        geometry, tokens = USD.load("UsdGeom"), USD.load("UsdGeom").Tokens
        is_material = groups.name == "material"
        family = MATERIALS if is_material else prim_name(groups.name)
        mesh = geometry.Imageable(self._mesh)
        for number, label in enumerate(groups.labels):
            name = unique_name(prim_name(label), used)
            subset = geometry.Subset.CreateGeomSubset(
                mesh, name, tokens.face, usd_array("int", np.empty(0)), family
            )
            faces = usd_array("int", np.flatnonzero(groups.numbers == number))
            subset.GetIndicesAttr().Set(faces, usd_time(code))
            set_display_name(subset.GetPrim(), label)
            if is_material:
                materials.bind(subset.GetPrim(), label)
        is_complete = code is None and (groups.numbers >= 0).all()
        kind = tokens.partition if is_complete else tokens.nonOverlapping
        geometry.Subset.SetFamilyType(mesh, family, kind)


def _columns(name: str, n_columns: int) -> list[tuple[str, slice]]:
    """Return primvars and their columns: opacity is separate from colors with four components."""
    if name == COLOR and n_columns == 4:
        return [(COLOR, slice(0, 3)), (OPACITY, slice(3, 4))]
    return [(name, slice(None))]


def _type_name(kind: Kind | TrackKind, name: str, dtype: np.dtype[Any], n_columns: int) -> str:
    """Return USD's name of the type of the values of an attribute or a track."""
    standard_name, role = NAMES_AND_TYPES.get(kind, ("", ""))
    type_name = f"{role}{n_columns}"
    if type_name in TYPES and (dtype.kind == "f" or is_color(kind, dtype)):
        is_single = dtype != np.float64 or (name == standard_name and name != UVS)
        return f"{type_name}{'f' if is_single else 'd'}"
    is_opacity = kind == TrackKind.COLOR and name == OPACITY and n_columns == 1
    return "float" if is_opacity else ELEMENTS[dtype.str[1:]]


def usd_array(type_name: str, values: npt.NDArray[Any]) -> Any:
    """Return values as an array of a type of the library, converted to its number type."""
    array, dtype = _array_type(type_name)
    values = values.astype(dtype, copy=False)
    is_flat = type_name in ELEMENTS.values()
    return array.FromNumpy(np.ascontiguousarray(values.ravel() if is_flat else values))


@cache
def _array_type(type_name: str) -> tuple[Any, np.dtype[Any]]:
    """Return the array class of a type of the library, and its number type."""
    value_type = USD.load("Sdf").ValueTypeNames.Find(f"{type_name}[]")
    array = getattr(USD.load("Vt"), value_type.type.pythonClass.__name__)
    return array, np.asarray(array(1)).dtype


def usd_time(code: float | None) -> Any:
    """Return a time code of USD; None is that of the default value."""
    return USD.load("Usd").TimeCode.Default() if code is None else code
