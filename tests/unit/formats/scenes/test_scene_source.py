from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.inspection import inspect_source
from meshreel.formats.options import Reading
from meshreel.formats.scenes.parts import split_parts
from meshreel.formats.scenes.scene_mesh import SceneMesh, Visibility
from meshreel.formats.scenes.scene_source import open_scene
from meshreel.formats.scenes.timing import neighbors
from meshreel.formats.scenes.visibility import meshes_in_turn
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Part, Surface
from meshreel.model.tracks import Track
from samples.materials import dressed, look
from samples.meshes import assert_same_surface, hard_sheet, quad_sheet, two_sheets, waving_grid

PATH = Path("scene.abc")


def scene_mesh(sequence, name, times_s=None):
    sizes = sequence.surface.sizes(len(sequence.faces))
    corners = join_triangles(sizes, sequence.faces)
    times = sequence.start_s + np.arange(sequence.n_frames) / 24 if times_s is None else times_s
    return SceneMesh(
        name,
        times,
        lambda frame: PolygonMesh(sequence.vertices[frame], sizes.astype(np.int64), corners),
        lambda frame: replace(sequence.surface, face_sizes=None),
    )


def opened(meshes, **options):
    whole = open_scene(lambda path, options: meshes, PATH, Reading(**options))
    return whole.segments[0] if whole.n_segments == 1 else whole


def test_merged_meshes_move_at_the_times_of_all_of_them():
    times_s, slow, fast = np.array([0, 50, 50.05, 100]), waving_grid(2), waving_grid(4)
    meshes = [scene_mesh(slow, "/slow", times_s[[0, 3]]), scene_mesh(fast, "/fast", times_s)]
    meshes.append(scene_mesh(fast[:1], "/still"))
    merged = opened(meshes, merge=True)
    assert merged.times.tolist() == times_s.tolist()
    share = times_s[:, np.newaxis, np.newaxis] / 100
    expected = (1 - share) * slow.vertices[:1] + share * slow.vertices[1:]
    np.testing.assert_allclose(merged.vertices[:, : slow.n_verts], expected, atol=1e-6)
    np.testing.assert_array_equal(merged.vertices[:, slow.n_verts : -fast.n_verts], fast.vertices)
    still = np.broadcast_to(fast.vertices[:1], fast.vertices.shape)
    np.testing.assert_array_equal(merged.vertices[:, -fast.n_verts :], still)


@pytest.mark.parametrize("surplus", [0, -1, -1000])
def test_larger_frames_than_allowed_stay_in_the_file(monkeypatch, surplus):
    monkeypatch.setattr("meshreel.formats.scenes.scene_source.BLOCK_BYTES", 1)
    sequence = quad_sheet()
    limit = sequence.vertices.nbytes + surplus
    result = opened([scene_mesh(sequence, "/root/sheet")], max_loaded_bytes=limit)
    assert isinstance(result, MeshSequence) == (surplus == 0)
    assert (result.name, result.fps, result.start_s) == ("sheet", 24.0, sequence.start_s)
    np.testing.assert_array_equal(result.faces, sequence.faces)
    assert result.read(0, sequence.n_frames).tobytes() == sequence.vertices.tobytes()
    assert_same_surface(result.surface, sequence.surface)
    np.testing.assert_array_equal(result.extent.low, sequence.extent.low)


@pytest.mark.parametrize("with_track", [(), (0,), (1,)])
def test_meshes_in_turn_share_a_surface_only_without_tracks(with_track, notes):
    track = {"heat": Track(np.zeros((1, 30), np.float32))}
    meshes = [
        replace(
            scene_mesh(quad_sheet(2 - number), f"/{number}"),
            fps=24.0 + number,  # that of a single frame has no effect
            visibility=Visibility(np.arange(2) / 24, np.arange(2) == number),
            tracks=lambda frames, tracks=track if number in with_track else {}: tracks,
        )
        for number in range(2)
    ]
    result = meshes_in_turn(meshes, "", notes, merges=False)
    assert (result.fps, result.keeps_surface(1)) == (24, not with_track)


def test_error_lists_the_meshes_if_none_is_selected():
    meshes = [scene_mesh(quad_sheet(), name) for name in ("/a", "/b")]
    with pytest.raises(InvalidInputError, match=r"2 meshes: /a, /b; choose one with object"):
        opened(meshes)


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        *((("/root/a", "/root/b"), wanted) for wanted in ("/root/b", "b", "root/b")),
        # The name of a parent selects its only mesh.
        *((("/Bone/Skin/Shape",), name) for name in ("/Bone", "Bone", "/Bone/Skin", "/", "/Bone/")),
        (("/Boneless/Shape2", "/Bone/Shape"), "/Bone"),
    ],
)
def test_mesh_is_selected_by_the_end_of_its_path_or_by_a_parent(names, wanted):
    meshes = [scene_mesh(quad_sheet(shift=shift), name) for shift, name in enumerate(names)]
    result = opened(meshes, object=wanted)
    assert result.name == names[-1].rpartition("/")[2]
    assert result.vertices.tobytes() == quad_sheet(shift=len(names) - 1).vertices.tobytes()


@pytest.mark.parametrize(
    ("names", "wanted", "which"),
    [
        (("/a/x", "/b/x"), "c", "no mesh"),
        (("/a/x", "/b/x"), "x", "2 meshes"),
        (("/Bone/a", "/Bone/b"), "/Bone", "2 meshes"),
        (("/Bone/a", "/Bone/b"), "/Bon", "no mesh"),
    ],
)
def test_name_of_no_mesh_or_several_lists_the_meshes(names, wanted, which):
    message = rf"{which} named '{wanted}'; it holds 2 meshes: {', '.join(names)}"
    with pytest.raises(InvalidInputError, match=message):
        opened([scene_mesh(quad_sheet(), name) for name in names], object=wanted)


def test_merge_option_merges_all_meshes():
    meshes = [scene_mesh(quad_sheet(shift=k), n) for k, n in ((0, "/root/a"), (2, "/root/b"))]
    result, expected = opened(meshes, merge=True), two_sheets()
    assert result.vertices.tobytes() == expected.vertices.tobytes()
    np.testing.assert_array_equal(result.faces, expected.faces)
    assert result.surface.parts == expected.surface.parts
    for one, other in zip(result.surface.attributes, expected.surface.attributes, strict=True):
        np.testing.assert_array_equal(one.per_item(), other.per_item())
    assert result.name == "scene"


def test_split_parts_inverts_merging():
    sequence, single = two_sheets(), quad_sheet()
    (whole,) = sequence.surface.groups
    numbers = np.where(np.arange(len(whole.numbers)) % 3, whole.numbers, -1)
    edges = np.array([[0, 1], [31, 32], [29, 30]])  # the last is between the parts
    surface = replace(sequence.surface, groups=(replace(whole, numbers=numbers),), hard_edges=edges)
    pieces = list(split_parts(sequence.faces, surface, sequence.n_verts, "whole"))
    assert [piece.name for piece in pieces] == ["/root/a", "/root/b"]
    for piece, own in zip(pieces, np.split(numbers, 2), strict=True):
        np.testing.assert_array_equal(piece.counts, single.surface.face_sizes)
        np.testing.assert_array_equal(
            piece.corners, join_triangles(single.surface.face_sizes, single.faces)
        )
        for one, other in zip(piece.surface.attributes, single.surface.attributes, strict=True):
            np.testing.assert_array_equal(one.per_item(), other.per_item())
        (groups,) = piece.surface.groups
        labels = np.array([*groups.labels, ""])[groups.numbers]
        assert labels.tolist() == np.array([*whole.labels, ""])[own].tolist()
    assert [piece.surface.hard_edges.tolist() for piece in pieces] == [[[0, 1]], [[1, 2]]]


def test_faces_across_parts_give_one_part():
    sequence = two_sheets()
    faces = sequence.faces.copy()
    faces[faces == faces[0, 0]] = 59
    (piece,) = split_parts(faces, sequence.surface, 60, "whole")
    assert (piece.name, piece.verts) == ("whole", slice(0, 60))


def test_merging_notes_attributes_that_some_meshes_lack(notes):
    bare = quad_sheet()
    bare = bare.replace(surface=Surface(bare.surface.face_sizes))
    meshes = [scene_mesh(quad_sheet(), "/full"), scene_mesh(bare, "/bare")]
    result = opened(meshes, merge=True, notes=notes)
    for attribute in result.surface.attributes:
        is_color, values = attribute.kind is Kind.COLOR, attribute.per_item()
        fill, words = (255, "white") if is_color else (0, "0")
        assert f"{attribute.kind} {attribute.name!r} is {words} in meshes without it" in notes
        assert (values[len(values) // 2 :] == fill).all()
    assert result.surface.groups[0].numbers[-1] == -1
    assert result.surface.parts == (Part("/full", 30, 21), Part("/bare", 30, 21))


@pytest.mark.parametrize("domain", [Domain.VERTEX, Domain.FACE])
def test_merging_unifies_domains_of_an_attribute(domain, notes):
    sheet = quad_sheet()
    n_items = {Domain.VERTEX: 30, Domain.FACE: 21}[domain]
    values = np.random.default_rng(4).random((n_items, 2)).astype(np.float32)
    surface = replace(
        sheet.surface, attributes=(Attribute("st", Kind.UV, domain, values, np.arange(n_items)),)
    )
    other = sheet.replace(surface=surface)
    meshes = [scene_mesh(sheet, "/seams"), scene_mesh(other, "/whole")]
    result = opened(meshes, merge=True, notes=notes)
    (uv,) = result.surface.of_kind(Kind.UV)
    frame = meshes[1].frame(0)
    item_of = frame.corners
    if domain is Domain.FACE:
        item_of = np.repeat(np.arange(21), frame.counts)
    expected = [sheet.surface.attributes[0].per_item(), values[item_of]]
    np.testing.assert_array_equal(uv.per_item(), np.concatenate(expected))
    assert not any("'st'" in note for note in notes)


def test_merging_renames_different_materials_of_one_name():
    materials, images = look()
    red, cloth = materials
    other = (replace(red, roughness=0.875), cloth)
    sheets = []
    for name, own in (("/a", materials), ("/b", other)):
        surface = replace(quad_sheet().surface, materials=own, images=images)
        sheets.append(scene_mesh(quad_sheet().replace(surface=surface), name))
    result = opened(sheets, merge=True).surface
    assert [material.name for material in result.materials] == ["red", "gr\u00fcn", "red_2"]
    assert result.images == images
    assert result.groups[0].labels == ("red", "gr\u00fcn", "red_2")
    n_faces = len(quad_sheet().surface.face_sizes)
    expected = np.array([2, 1])[quad_sheet().surface.groups[0].numbers]
    np.testing.assert_array_equal(result.groups[0].numbers[n_faces:], expected)


@pytest.mark.parametrize("n_together", [1, 3, 9])
def test_changing_faces_begin_another_segment(n_together, monkeypatch):
    mesh = scene_mesh(quad_sheet(4), "/a")
    block_bytes = n_together * mesh.frame(0).vertices.nbytes - 1
    monkeypatch.setattr("meshreel.formats.scenes.scene_source.BLOCK_BYTES", block_bytes)
    other = PolygonMesh(np.zeros((9, 3), np.float32), np.array([3]), np.array([0, 1, 2], np.int32))
    frames = [mesh.frame(0), mesh.frame(1), other, other]
    segments = opened([SceneMesh("/a", mesh.times_s, frames.__getitem__)]).segments
    assert [(one.n_frames, one.n_verts) for one in segments] == [
        (2, mesh.frame(0).vertices.shape[0]),
        (2, 9),
    ]


@pytest.mark.parametrize("block_bytes", [1, 1 << 20])
def test_open_scene_reports_the_first_fault_when_frames_are_in_blocks(block_bytes, monkeypatch):
    monkeypatch.setattr("meshreel.formats.scenes.scene_source.BLOCK_BYTES", block_bytes)
    sequence = quad_sheet()
    broken = sequence.vertices.copy()
    broken[3, 2, 1] = np.nan
    whole = scene_mesh(sequence, "/sheet")

    def frame(index):
        mesh = whole.frame(index)
        return replace(mesh, vertices=broken[index], corners=mesh.corners[:: 1 - 2 * (index == 4)])

    with pytest.raises(InvalidInputError, match="vertex 2 of frame 3 has y = nan"):
        opened([replace(whole, frame=frame)])


def test_errors_name_the_file():
    def read_meshes(path, options):
        raise FormatError("is not an archive")

    with pytest.raises(FormatError, match=r"scene\.abc: is not an archive"):
        open_scene(read_meshes, PATH, Reading())


def test_glb_files_of_one_frame_each_become_a_sequence(tmp_path):
    sequence = waving_grid(5)
    for number in range(5):
        meshreel.save(sequence[number : number + 1], tmp_path / f"f_{number}.glb")
    loaded = meshreel.load(str(tmp_path / "f_*.glb"), fps=12)
    assert (loaded.n_frames, loaded.fps, loaded.name) == (5, 12, tmp_path.name)
    np.testing.assert_allclose(loaded.vertices, sequence.vertices, atol=1e-4)
    assert meshreel.load(str(tmp_path / "f_*.glb")).fps == 0
    info = inspect_source(str(tmp_path / "f_*.glb"), Reading())
    assert (info.n_files, [mesh.n_frames for mesh in info.meshes]) == (5, [5])


def test_materials_of_later_files_are_noted(tmp_path, notes):
    first = dressed(hard_sheet()[:1])
    for number, roughness in enumerate((0.2, 0.2, 0.4)):
        red, *others = first.surface.materials
        materials = (replace(red, roughness=roughness), *others)
        surface = replace(first.surface, materials=materials)
        meshreel.save(first.replace(surface=surface), tmp_path / f"f_{number}.glb")
    loaded = meshreel.load(str(tmp_path / "f_*.glb"), notes=notes)
    assert loaded.surface.materials[0].roughness == 0.2
    assert notes[-1] == "left out: changes over time, kept as in the first frame: red"


def test_faces_may_differ_between_files(tmp_path):
    meshreel.save(waving_grid(1), tmp_path / "f_0.glb")
    meshreel.save(meshreel.simulate_flag(1, n_rows=4, n_columns=5), tmp_path / "f_1.glb")
    loaded = meshreel.load([tmp_path / "f_0.glb", tmp_path / "f_1.glb"])
    assert [segment.n_frames for segment in loaded.segments] == [1, 1]


def test_files_of_several_frames_are_refused_by_name(tmp_path):
    meshreel.save(waving_grid(1), tmp_path / "a.glb")
    meshreel.save(waving_grid(3).replace(fps=24.0), tmp_path / "b.glb")
    with pytest.raises(FormatError, match=r"b\.glb has 3 frames; files that are read together"):
        meshreel.load([tmp_path / "a.glb", tmp_path / "b.glb"])


@pytest.mark.parametrize(
    ("time_s", "expected"),
    [
        (0.0, (0, 0, 0.0)),
        (1.0, (0, 0, 0.0)),
        (1.0005, (0, 0, 0.0)),
        (1.9995, (1, 1, 0.0)),
        (3.0, (1, 2, 0.5)),
        (9.0, (2, 2, 0.0)),
    ],
)
def test_neighbors_snaps_to_a_frame_when_the_time_is_close(time_s, expected):
    assert neighbors(np.array([1.0, 2.0, 4.0]), time_s) == expected
