"""VTK files that meshreel writes, read by VTK and by meshreel."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind
from meshreel.model.tracks import Track, domain_sizes
from meshreel.operations.save import save
from samples.meshes import assert_same_surface, quad_sheet, two_sheets
from samples.tracks import assert_same_tracks, tracked_sheet

pytest.importorskip("vtkmodules")
pytest.importorskip("h5py")
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDataArray
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

DOMAINS = ("vertex", "face")
N_FRAMES = 4
FRAMES = {".vtp": vtkXMLPolyDataReader, ".vtu": vtkXMLUnstructuredGridReader}


def mixed_sheet(n_frames=N_FRAMES, domains=DOMAINS):
    """The sheet with tracks, normals and units whose names need escaping in XML."""
    sheet = tracked_sheet(n_frames, domains)
    sizes = domain_sizes(sheet.n_verts, sheet.n_faces, sheet.surface)
    normals = np.random.default_rng(3).normal(size=(n_frames, sizes[Domain.VERTEX], 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    constant = np.arange(sizes[Domain.FACE], dtype=np.int16)
    tracks = {
        "N & <n>": Track(normals, kind="normal"),
        'druck "ü"': Track(normals[..., 0], unit="kg/m² & <s>"),
        "number": Track(np.tile(constant, (n_frames, 1)), "face"),
        "uv": Track(normals[..., :2], kind="uv"),
    }
    return sheet.replace(tracks={**sheet.tracks, **tracks})


def without_unsupported(sheet):
    """The sheet without what VTK cannot store: corner attributes and group labels."""
    kept = [
        attribute for attribute in sheet.surface.attributes if attribute.domain is not Domain.CORNER
    ]
    surface = replace(sheet.surface, attributes=tuple(kept), groups=())
    return sheet.replace(surface=surface)


def read_with(reader_class, path):
    reader = reader_class()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def corners_of(found):
    cells = map(found.GetCell, range(found.GetNumberOfCells()))
    return [cell.GetPointId(k) for cell in cells for k in range(cell.GetNumberOfPoints())]


def assert_holds(found, sheet, frame):
    """Assert that a VTK dataset has the positions, faces, tracks and units of a frame."""
    positions = vtk_to_numpy(found.GetPoints().GetData())
    assert positions.dtype == sheet.vertices.dtype
    assert np.array_equal(positions, sheet.vertices[frame])
    assert found.GetNumberOfCells() == sheet.surface.n_faces(sheet.n_faces)
    for name, track in sheet.tracks.items():
        data = found.GetPointData() if track.domain == "vertex" else found.GetCellData()
        array = data.GetArray(name)
        values = vtk_to_numpy(array)
        assert values.dtype == track.dtype
        assert values.tobytes() == track[frame].tobytes()
        unit = array.GetInformation().Get(vtkDataArray.UNITS_LABEL())
        assert (unit or "").strip() == track.unit


@pytest.mark.parametrize("extension", FRAMES)
def test_vtk_reads_positions_tracks_and_units_of_frame_files(tmp_path, extension):
    sheet = mixed_sheet()
    paths = save(sheet, tmp_path / f"f_%02d{extension}")
    assert len(paths) == N_FRAMES
    for frame, path in enumerate(paths):
        result = read_with(FRAMES[extension], path)
        assert_holds(result, sheet, frame)
        assert result.GetPointData().GetNormals().GetName() == "N & <n>"
        assert (
            corners_of(result)
            == join_triangles(sheet.surface.sizes(sheet.n_faces), sheet.faces).tolist()
        )


def test_vtk_reads_the_files_of_a_collection(tmp_path):
    sheet = mixed_sheet()
    path, *pieces = save(sheet, tmp_path / "a & b.pvd")
    assert [one.relative_to(tmp_path).as_posix() for one in pieces] == [
        f"a & b_frames/a & b_000{frame}.vtu" for frame in range(N_FRAMES)
    ]
    for frame, piece in enumerate(pieces):
        assert_holds(read_with(vtkXMLUnstructuredGridReader, piece), sheet, frame)
    assert f'timestep="{sheet.start_s!r}"' in path.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("n_frames", [1, N_FRAMES])
def test_collections_round_trip_exactly(tmp_path, n_frames, read, notes):
    sheet = without_unsupported(mixed_sheet(n_frames)).replace(start_s=1.5)
    path, *_ = save(sheet, tmp_path / "a.pvd")
    result = read(path, notes=notes)
    assert result.read(0, n_frames).tobytes() == sheet.vertices.tobytes()
    assert (result.fps, result.start_s) == (sheet.fps if n_frames > 1 else 0, 1.5)
    assert_same_surface(result.surface, sheet.surface)
    assert_same_tracks(result.tracks, sheet.tracks)
    assert notes == []


@pytest.mark.parametrize("extension", FRAMES)
def test_tracks_of_frame_files_round_trip_exactly(tmp_path, extension):
    sheet = without_unsupported(mixed_sheet())
    area = np.arange(sheet.surface.n_faces(sheet.n_faces), dtype=np.float64)[:, np.newaxis]
    constant = Attribute("area", Kind.OTHER, Domain.FACE, area)
    attributes = (*sheet.surface.attributes, constant)
    sheet = sheet.replace(surface=replace(sheet.surface, attributes=attributes))
    save(sheet, tmp_path / f"f_%02d{extension}")
    loaded = load(tmp_path / f"f_*{extension}")
    assert_same_tracks(loaded.tracks, sheet.tracks)
    assert_same_surface(loaded.surface, sheet.surface)


@pytest.mark.parametrize("extension", [".pvd", "_%d.vtp", "_%d.vtu"])
def test_notes_list_what_vtk_cannot_store(tmp_path, extension, notes):
    sheet = two_sheets()
    numbers = np.zeros(sheet.surface.n_faces(sheet.n_faces), np.int32)
    seams = Attribute(
        "seam", Kind.OTHER, Domain.CORNER, np.ones((sheet.surface.sizes(sheet.n_faces).sum(), 1))
    )
    surface = replace(
        sheet.surface,
        attributes=(*sheet.surface.attributes, seams),
        groups=(FaceGroups("material", ("red",), numbers),),
    )
    tracks = {"shear": Track(np.ones((sheet.n_frames, len(seams.values))), "corner")}
    sheet = sheet.replace(surface=surface, tracks=tracks)
    save(sheet, tmp_path / f"a{extension}", notes=notes)
    shown = extension[-4:] if extension.endswith(("p", "u")) else extension
    assert f"tracks left out: shear: {shown} cannot store tracks of corners" in notes
    assert f"labels left out: groups 'material'; {shown} stores only their numbers" in notes
    [note] = [one for one in notes if one.startswith("left out") and "frame rate" not in one]
    assert "'seam' (other) of each corner" in note
    assert "the names of 2 parts" in note


def test_unknown_frame_rate_is_written_as_24_with_a_note(tmp_path, notes):
    path, *_ = save(quad_sheet(3).replace(fps=0), tmp_path / "a.pvd", notes=notes)
    assert "the frame rate is unknown; written as 24 fps" in notes
    assert load(path).fps == 24


def test_save_does_not_replace_existing_data_files(tmp_path):
    path, *beside = save(quad_sheet(2), tmp_path / "a.pvd")
    path.unlink()
    before = beside[-1].read_bytes()
    with pytest.raises(InvalidInputError, match="0000"):
        save(quad_sheet(3), tmp_path / "a.pvd")
    assert beside[-1].read_bytes() == before
    assert not path.exists()
    save(quad_sheet(3), tmp_path / "a.pvd", overwrite=True)
    assert load(path).n_frames == 3


def test_failed_write_leaves_no_files(tmp_path):
    sheet = quad_sheet(3)

    class Failing(type(sheet)):
        def read(self, start, stop):
            if start == 2:
                raise InvalidInputError("no more frames")
            return super().read(start, stop)

    failing = Failing(sheet.vertices, sheet.faces, sheet.fps)
    with pytest.raises(InvalidInputError, match="no more frames"):
        save(failing, tmp_path / "a.pvd")
    assert list(tmp_path.iterdir()) == []
