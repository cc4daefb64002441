"""Valid and unique USD names and paths for parts and groups."""

import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.frames.segmented_stream import SegmentedStream
from meshreel.formats.frames.shared_data import Key, SharedData, sharing_materials
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.surfaces.images import image_names
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.material_writing import (
    Materials,
    TextureWriter,
    prim_name,
    set_display_name,
    unique_name,
)
from meshreel.formats.usd.materials import MATERIALS
from meshreel.formats.usd.quantities import (
    COMPUTED,
    IS_ATTRIBUTE,
    STANDARD_NAMES,
    TRACK_KIND,
    TRACK_NAME,
    UNIT,
)
from meshreel.formats.usd.sampling import snap
from meshreel.formats.usd.stage import DEFAULT_RATE, usd_errors
from meshreel.model.extent import Corners
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.materials import Image
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource
from meshreel.runtime.extras import USD

Elements = tuple[str, ...]


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
    cleaned = [_elements(name) for name in names]
    firsts = {elements[0] for elements in cleaned}
    if len(firsts) > 1 or any(len(elements) < 2 for elements in cleaned):
        cleaned = [(prim_name(root), *elements) for elements in cleaned]
    ancestors = {elements[:n] for elements in cleaned for n in range(1, len(elements))}
    used: set[str] = set()
    paths = []
    for elements in cleaned:
        while elements in ancestors:  # meshes must not be below meshes
            elements = (*elements, elements[-1])
        path = unique_name(_path(elements), used | {_path(one) for one in ancestors})
        used.add(path)
        paths.append(path)
    return paths


def _elements(name: str) -> Elements:
    return tuple(prim_name(element) for element in name.split("/") if element) or (prim_name(""),)


def _path(elements: Elements) -> str:
    return "/" + "/".join(elements)


INTERPOLATIONS = {
    Domain.VERTEX: "vertex",
    Domain.FACE: "uniform",
    Domain.CORNER: "faceVarying",
}
BYTE_COLORS = "colors are written as float32, not bytes, since USD has no byte colors"
NARROW_COLORS = "colors are rounded to float32"


class MeshWriter:
    """Writes a mesh at a path of a stage: faces at once, points frame by frame.

    Parameters
    ----------
    stage : Usd.Stage
    part : PartMesh
        The mesh in the first segment.
    has_normals : bool
        Whether to write normals computed from hard edges.

    Attributes
    ----------
    prim : Usd.Prim
    part : PartMesh
        The mesh in the current segment.
    """

    def __init__(self, stage: Any, path: str, part: PartMesh, *, has_normals: bool) -> None:
        geometry = USD.load("UsdGeom")
        _define_ancestors(stage, path)
        self._mesh = geometry.Mesh.Define(stage, path)
        self._mesh.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
        self.prim, self.part = self._mesh.GetPrim(), part
        self._points, self._extent = self._mesh.CreatePointsAttr(), self._mesh.CreateExtentAttr()
        self._array = USD.load("Vt").Vec3fArray
        self._shading: RowNormals | None = None
        self._normals = _normals_primvar(self.prim) if has_normals else None

    def begin(self, part: PartMesh, code: float | None) -> None:
        """Write the faces of a segment.

        Parameters
        ----------
        code : float or None
            The time code; None writes the default value, of the only segment.
        """
        self.part, when = part, _time_code(code)
        integers = USD.load("Vt").IntArray
        self._mesh.CreateFaceVertexCountsAttr().Set(integers.FromNumpy(part.counts), when)
        self._mesh.CreateFaceVertexIndicesAttr().Set(integers.FromNumpy(part.corners), when)
        if self._normals is not None:
            n_verts = part.verts.stop - part.verts.start
            hard_edges = part.surface.hard_edges
            self._shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)
            self._normals.SetIndices(integers.FromNumpy(self._shading.rows.of_corner), when)

    def write_points(self, frame: npt.NDArray[np.float32], code: float | None) -> None:
        """Write points of a frame, their extent, and normals if the mesh has them.

        Parameters
        ----------
        frame : float32 array of shape (V, 3)
            Positions of all vertices of the sequence.
        code : float or None
            The time code; None writes the default value.
        """
        points = np.ascontiguousarray(frame[self.part.verts])
        extent = np.stack([points.min(axis=0), points.max(axis=0)])
        when = _time_code(code)
        self._points.Set(self._array.FromNumpy(points), when)
        self._extent.Set(self._array.FromNumpy(extent), when)
        if self._normals is not None and self._shading is not None:
            normals = self._shading.of_frames(points[np.newaxis])[0].astype(np.float32)
            self._normals.Set(self._array.FromNumpy(np.ascontiguousarray(normals)), when)


def _time_code(code: float | None) -> Any:
    """Return a time code of USD; None is that of the default value."""
    return USD.load("Usd").TimeCode.Default() if code is None else code


def _normals_primvar(prim: Any) -> Any:
    """Return a primvar of corner normals, marked as computed."""
    api, sdf = USD.load("UsdGeom").PrimvarsAPI(prim), USD.load("Sdf")
    normals = api.CreatePrimvar("normals", sdf.ValueTypeNames.Normal3fArray, "faceVarying")
    normals.GetAttr().SetCustomDataByKey(COMPUTED, True)
    return normals


def _define_ancestors(stage: Any, path: str) -> None:
    """Define missing prims above a path as transforms."""
    elements = path.split("/")[1:-1]
    for n_elements in range(1, len(elements) + 1):
        above = "/" + "/".join(elements[:n_elements])
        if not stage.GetPrimAtPath(above):
            USD.load("UsdGeom").Xform.Define(stage, above)


def write_surface(
    prim: Any,
    surface: Surface,
    n_faces: int,
    materials: Materials,
    notes: list[str],
    codes: Sequence[float | None] = (None,),
    all_labels: Mapping[Key, tuple[str, ...]] | None = None,
) -> None:
    """Write the attributes and groups of a mesh to its prim.

    The first UVs are called ``st`` and the first colors ``displayColor``, unless other attributes
    have these names.

    Parameters
    ----------
    prim : Usd.Prim
    surface : Surface
        Without parts.
    notes : list of str
        Gains a sentence where USD stores another number type.
    codes : sequence of float or None
        Time codes of the samples; None writes the default value. Floats need a sample at the first
        and the last frame of a segment, since USD interpolates them.
    all_labels : dict, optional
        Labels of the groups in all segments, if there are several.
    """
    api = USD.load("UsdGeom").PrimvarsAPI(prim)
    for attribute, name in primvar_names(surface):
        _write_attribute(api, attribute, name, notes, codes)
    subsets: set[str] = set()
    for groups in surface.groups:
        one = groups if all_labels is None else _with_labels(groups, all_labels[(groups.name,)])
        is_single = len(one.labels) == 1 and (one.numbers == 0).all() and all_labels is None
        if one.name == "material":
            materials.write_double_sided(prim, one)
        if one.name == "material" and is_single:
            materials.bind(prim, one.labels[0])
        else:
            _write_groups(prim, one, materials, subsets, codes[0])


def _with_labels(groups: FaceGroups, labels: tuple[str, ...]) -> FaceGroups:
    """Return groups with further labels, in the order of all of them."""
    new = [*map(labels.index, groups.labels), -1]
    return FaceGroups(groups.name, labels, np.array(new, np.int32)[groups.numbers])


def uv_primvars(surface: Surface) -> dict[str, str]:
    """Return the primvar of each UV set, by name of its attribute."""
    names = [(one.name, name) for one, name in primvar_names(surface) if one.kind is Kind.UV]
    return dict(reversed(names))


def primvar_names(surface: Surface) -> list[tuple[Attribute, str]]:
    """Return attributes with their unique primvar names."""
    names = {id(one): prim_name(one.name) for one in surface.attributes}
    for kind, standard in STANDARD_NAMES.items():
        own = surface.of_kind(kind)
        if own and standard not in names.values():
            names[id(own[0])] = standard
    used: set[str] = set()
    return [(one, unique_name(names[id(one)], used)) for one in surface.attributes]


def _write_attribute(
    api: Any,
    attribute: Attribute,
    name: str,
    notes: list[str],
    codes: Sequence[float | None],
) -> None:
    values = attribute.values
    if attribute.kind is Kind.COLOR and values.dtype != np.float32:
        note = BYTE_COLORS if values.dtype == np.uint8 else NARROW_COLORS
        if note not in notes:
            notes.append(note)
        scale = 255 if values.dtype == np.uint8 else 1
        values = (values / scale).astype(np.float32)
    if name == "displayColor" and values.shape[1] == 4:
        _write_primvar(api, attribute, "displayOpacity", "float", values[:, 3:], codes)
        values = values[:, :3]
    _write_primvar(api, attribute, name, _primvar_type(attribute.kind, values), values, codes)


def _primvar_type(kind: Kind, values: npt.NDArray[Any]) -> str:
    """Return USD's name of the element type."""
    letter = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}[values.dtype.str[1:]]
    if kind is Kind.UV and values.shape[1] == 2 and values.dtype.kind == "f":
        return f"texCoord2{letter[0]}"
    if kind is Kind.COLOR and values.shape[1] in (3, 4):
        return f"color{values.shape[1]}f"
    return letter


def _write_primvar(
    api: Any,
    attribute: Attribute,
    name: str,
    type_name: str,
    values: npt.NDArray[Any],
    codes: Sequence[float | None],
) -> None:
    sdf, arrays = USD.load("Sdf"), USD.load("Vt")
    declared = sdf.ValueTypeNames.Find(f"{type_name}[]")
    is_flat = type_name in ("uchar", "int", "float", "double")
    width = values.shape[1] if is_flat else 1
    indices = attribute.indices
    is_constant = (
        attribute.kind is Kind.COLOR
        and attribute.domain is Domain.VERTEX
        and indices is not None
        and len(values) == 1
        and codes[0] is None  # other segments may have several colors
    )
    interpolation = "constant" if is_constant else INTERPOLATIONS[attribute.domain]
    primvar = api.CreatePrimvar(name, declared, interpolation, width)
    array_class = getattr(arrays, declared.type.pythonClass.__name__)
    data = np.ascontiguousarray(values.ravel() if is_flat else values)
    if codes[0] is not None:
        primvar.GetAttr().SetCustomDataByKey(IS_ATTRIBUTE, True)
    for code in codes:
        primvar.Set(array_class.FromNumpy(data), _time_code(code))
    if indices is not None and not is_constant:
        primvar.SetIndices(arrays.IntArray.FromNumpy(indices), _time_code(codes[0]))


def _write_groups(
    prim: Any, groups: FaceGroups, materials: Materials, used: set[str], code: float | None
) -> None:
    geometry, arrays = USD.load("UsdGeom"), USD.load("Vt")
    is_material = groups.name == "material"
    family = MATERIALS if is_material else prim_name(groups.name)
    mesh = geometry.Imageable(prim)
    for number, label in enumerate(groups.labels):
        faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
        name = unique_name(prim_name(label), used)
        indices = arrays.IntArray.FromNumpy(faces)
        default = indices if code is None else arrays.IntArray()
        subset = geometry.Subset.CreateGeomSubset(mesh, name, geometry.Tokens.face, default, family)
        if code is not None:
            subset.GetIndicesAttr().Set(indices, code)
        set_display_name(subset.GetPrim(), label)
        if is_material:
            materials.bind(subset.GetPrim(), label)
    is_complete = code is None and (groups.numbers >= 0).all()
    tokens = geometry.Tokens
    geometry.Subset.SetFamilyType(
        mesh, family, tokens.partition if is_complete else tokens.nonOverlapping
    )


ELEMENTS = {
    "u1": "uchar", "i1": "int", "u2": "int", "i2": "int", "i4": "int", "u4": "uint",
    "i8": "int64", "u8": "uint64", "f4": "float", "f8": "double",
}  # fmt: skip
"""USD's element type for each number type, without loss."""

VELOCITIES, NORMALS = "velocities", "normals"
COLOR, OPACITY, UVS = "displayColor", "displayOpacity", "st"
TRACK_NAMES = {
    TrackKind.VELOCITY: VELOCITIES,
    TrackKind.NORMAL: NORMALS,
    TrackKind.COLOR: COLOR,
    TrackKind.UV: UVS,
}
"""Standard names, which programs use by default."""


class TrackWriter:
    """Writes a track of a mesh, frame by frame.

    Parameters
    ----------
    name : str
        Name of the track.
    items : slice
        Items of the mesh among those of the sequence.
    columns : slice
        Components of a value to write.
    attribute : Usd.Attribute
    type_name : Sdf.ValueTypeName
    is_flat : bool
        Whether a value consists of several elements.
    scale : float
        Divisor of the numbers.
    """

    def __init__(
        self,
        name: str,
        items: slice,
        columns: slice,
        attribute: Any,
        type_name: Any,
        *,
        is_flat: bool,
        scale: float,
    ) -> None:
        self.name = name
        self._items, self._columns, self._scale = items, columns, scale
        self._attribute, self._is_flat = attribute, is_flat
        self._array = getattr(USD.load("Vt"), type_name.type.pythonClass.__name__)
        self._dtype = np.asarray(self._array(1)).dtype

    def write(self, values: Values, code: float | None) -> None:
        """Write the values of a frame.

        Parameters
        ----------
        values : array of shape (N, C)
            Values of all meshes of the sequence.
        code : float or None
            The time code; None writes the default value.
        """
        own = values[self._items, self._columns]
        own = (own / self._scale if self._scale != 1 else own).astype(self._dtype)
        data = np.ascontiguousarray(own.ravel() if self._is_flat else own)
        when = USD.load("Usd").TimeCode.Default() if code is None else code
        self._attribute.Set(self._array.FromNumpy(data), when)


def track_writers(mesh: MeshWriter, stream: FrameStream) -> Iterator[TrackWriter]:
    """Yield writers for the tracks of a stream on one of its meshes.

    The first vertex velocities and normals become those of the mesh; the first colors are called
    ``displayColor`` and the first UVs ``st``, unless attributes have these names. Notes of the
    stream gain a sentence where USD stores another number type.
    """
    used = {name for _, name in primvar_names(mesh.part.surface)}
    used |= {OPACITY} if COLOR in used else set()
    for name, track in stream.tracks.items():
        yield from _writers(mesh, name, track, used, stream.notes)


def _writers(
    mesh: MeshWriter, name: str, track: TrackSource, used: set[str], notes: list[str]
) -> Iterator[TrackWriter]:
    written_name, n_columns = _choose_name(name, track, used), track.shape[2]
    splits_opacity = written_name == COLOR and n_columns == 4
    is_flat, kind = _track_type(written_name, track, 3 if splits_opacity else n_columns)
    declared = USD.load("Sdf").ValueTypeNames.Find(f"{kind}[]")
    scale = 255.0 if track.kind is TrackKind.COLOR and track.dtype == np.uint8 else 1.0
    _note_type(name, track, kind, notes)

    def writer(primvar: str, type_name: Any, columns: slice, element_size: int) -> TrackWriter:
        attribute = _attribute(mesh, primvar, type_name, track, element_size)
        _write_custom_data(attribute, name, track)
        items = mesh.part.items[track.domain]
        is_element = type_name in _element_types()
        return TrackWriter(
            name, items, columns, attribute, type_name, is_flat=is_element, scale=scale
        )

    if not splits_opacity:
        yield writer(written_name, declared, slice(None), n_columns if is_flat else 1)
        return
    used.add(OPACITY)
    yield writer(COLOR, declared, slice(0, 3), 1)
    yield writer(OPACITY, USD.load("Sdf").ValueTypeNames.FloatArray, slice(3, 4), 1)


def _element_types() -> list[Any]:
    """Return the array types of single numbers."""
    find = USD.load("Sdf").ValueTypeNames.Find
    return [find(f"{element}[]") for element in set(ELEMENTS.values())]


def _choose_name(name: str, track: TrackSource, used: set[str]) -> str:
    """Return an unused name of a primvar or mesh attribute, and add it to `used`."""
    standard = TRACK_NAMES.get(track.kind, "")
    is_possible = standard != VELOCITIES or track.domain is Domain.VERTEX
    has_opacity = standard == COLOR and OPACITY in used
    if standard and is_possible and standard not in used and not has_opacity:
        used.add(standard)
        return standard
    # Programs would misinterpret other tracks with standard names.
    unique = unique_name(prim_name(name), used | {*TRACK_NAMES.values(), OPACITY})
    used.add(unique)
    return unique


def _track_type(name: str, track: TrackSource, n_columns: int) -> tuple[bool, str]:
    """Return whether single numbers are written, and USD's name of the type."""
    element = ELEMENTS[track.dtype.str[1:]]
    if name in (VELOCITIES, NORMALS):
        return False, {VELOCITIES: "vector3f", NORMALS: "normal3f"}[name]
    if track.kind is TrackKind.COLOR and (track.dtype.kind == "f" or track.dtype == np.uint8):
        is_double = track.dtype == np.float64 and name != COLOR
        return False, f"color{n_columns}{'d' if is_double else 'f'}"
    if element in ("float", "double"):
        letter = element[0]
        if track.kind is TrackKind.UV:
            return False, f"texCoord2{letter}"
        if track.kind in (TrackKind.VECTOR, TrackKind.VELOCITY) and n_columns == 3:
            return False, f"vector3{letter}"
        if track.kind is TrackKind.NORMAL:
            return False, f"normal3{letter}"
    return True, element


def _note_type(name: str, track: TrackSource, kind: str, notes: list[str]) -> None:
    """Note that USD stores another number type."""
    letter = kind[-1] if kind[-2].isdigit() else kind[0]
    is_rounded = track.dtype == np.float64 and letter == "f"
    is_scaled = track.dtype == np.uint8 and kind.startswith("color")
    is_widened = track.dtype.str[1:] in ("i1", "i2", "u2")
    if is_rounded or is_scaled or is_widened:
        written = "int32" if is_widened else "float32"
        note = f"track {name!r} is written as {written}, not {track.dtype}, a type that USD lacks"
        notes.extend([note] if note not in notes else [])


def _attribute(
    mesh: MeshWriter, name: str, type_name: Any, track: TrackSource, element_size: int
) -> Any:
    geometry = USD.load("UsdGeom")
    interpolation = INTERPOLATIONS[track.domain]
    if name == VELOCITIES:
        return geometry.Mesh(mesh.prim).CreateVelocitiesAttr()
    if name == NORMALS:
        usd_mesh = geometry.Mesh(mesh.prim)
        usd_mesh.SetNormalsInterpolation(interpolation)
        return usd_mesh.CreateNormalsAttr()
    api = geometry.PrimvarsAPI(mesh.prim)
    return api.CreatePrimvar(name, type_name, interpolation, element_size).GetAttr()


def _write_custom_data(attribute: Any, name: str, track: TrackSource) -> None:
    """Write the kind, name and unit of a track, for which USD has no schema, as custom data."""
    entries = {TRACK_KIND: str(track.kind), TRACK_NAME: name, UNIT: track.unit}
    for key, text in entries.items():
        if text:
            attribute.SetCustomDataByKey(key, text.encode("utf-8", "replace").decode())


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
