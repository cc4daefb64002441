import numpy as np
import pytest

import meshreel
from meshreel.errors import ConnectivityChangeError, InvalidInputError
from meshreel.formats.gltf.rigged import align_influences
from samples.glb import Glb
from samples.rigs import bending_tube, boxes, turn
from unit.formats.gltf.test_write import two_parts


def saved(tmp_path, sequence, **options):
    notes, path = [], tmp_path / "rig.glb"
    meshreel.save(sequence, path, notes=notes, rig=True, **options)
    return path, notes


@pytest.mark.parametrize("compression", [True, False])
@pytest.mark.parametrize("bulge", [0.0, 0.3])
def test_read_back_positions_are_those_of_the_rig(tmp_path, compression, bulge):
    tube = bending_tube(bulge=bulge)
    options = {"rig": 2} if bulge else {}
    path = tmp_path / "tube.glb"
    meshreel.save(tube, path, compression=compression, **{"rig": True, **options})
    rig, back = meshreel.rig(tube, options.get("rig")), meshreel.load(path)
    assert (rig.n_targets > 0) == bool(bulge)
    assert back.n_frames == tube.n_frames
    assert back.fps == 25
    shown, found = rig.positions() + rig.origin, back.vertices
    if compression:  # vertices are reordered
        quality = meshreel.compare(tube, back)
        assert quality.kg_error_percent == pytest.approx(rig.errors.kg_percent, abs=1e-4)
    difference = np.sort(found, axis=1) - np.sort(shown, axis=1)
    assert np.abs(difference).max() <= 1e-5 * np.ptp(shown)


def test_notes_name_errors_and_bytes(tmp_path):
    path, notes = saved(tmp_path, bending_tube())
    assert notes[0].startswith("the rig has ")
    assert "KG error" in notes[0]
    assert notes[1].startswith(f"{path.stat().st_size / 1e3:.0f} kB: mesh ")


def test_skeleton_is_a_tree_of_named_nodes_below_one(tmp_path):
    glb = Glb.read(saved(tmp_path, bending_tube())[0].read_bytes())
    [skin] = glb.document["skins"]
    nodes = glb.document["nodes"]
    names = [nodes[joint]["name"] for joint in skin["joints"]]
    assert names[0].startswith("bone_")
    children = [child for node in nodes for child in node.get("children", [])]
    assert set(skin["joints"]) <= set(children)
    assert sorted(children) == sorted(set(children))
    [mesh] = [node for node in nodes if "mesh" in node]
    assert mesh["skin"] == 0


def test_parts_with_attributes_share_the_skeleton(tmp_path):
    pair = two_parts()
    path, _ = saved(tmp_path, pair)
    glb = Glb.read(path.read_bytes())
    assert [node.get("skin") for node in glb.document["nodes"] if "mesh" in node] == [0, 0]
    back = meshreel.load(path, merge=True)
    assert [part.name for part in back.surface.parts] == ["/left", "/right"]


def test_vertices_without_faces_are_left_out(tmp_path):
    tube = bending_tube()
    extra = np.concatenate([tube.vertices, tube.vertices[:, :1] + 1], axis=1)
    path, notes = saved(tmp_path, tube.replace(vertices=extra))
    assert "left out 1 vertex that no face uses" in notes
    assert meshreel.load(path).n_verts == tube.n_verts


def test_one_frame_is_written_without_animation(tmp_path):
    path, _ = saved(tmp_path, bending_tube()[:1])
    assert "animations" not in Glb.read(path.read_bytes()).document
    assert meshreel.load(path).n_frames == 1


def test_rigid_motion_has_no_more_channels_than_it_needs(tmp_path):
    sequence = boxes([lambda t: np.eye(3), lambda t: turn(0.2 * t)])
    glb = Glb.read(saved(tmp_path, sequence)[0].read_bytes())
    assert len(glb.document["animations"][0]["channels"]) <= 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"targets": 3}, "targets is for animations without bones"),
        ({"rig": None, "kg": 1.0}, "kg is a bound of rigs; add rig"),
        ({"rig": None, "quality": 50}, "quality is a bound of rigs; add rig"),
        ({"quality": 50, "kg": 1.0}, "omit it, or kg"),
        ({"quality": 50, "max_error": 1.0}, "omit it, or max_error"),
        ({"rig": 300}, "rig takes 1 to 256 bones; got 300"),
    ],
)
def test_contradicting_options_are_refused(tmp_path, options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.save(bending_tube(), tmp_path / "a.glb", **{"rig": True, **options})
    assert not list(tmp_path.iterdir())


def test_changing_faces_are_refused(tmp_path):
    both = meshreel.concatenate([bending_tube(), boxes([lambda t: np.eye(3)])])
    with pytest.raises(ConnectivityChangeError, match="meshreel register"):
        saved(tmp_path, both)


def test_forced_rig_notes_its_bounds(tmp_path, notes):
    noise = np.random.default_rng(6).normal(size=(150, 60, 3))
    faces = np.arange(60, dtype=np.int32).reshape(-1, 3)
    sequence = meshreel.MeshSequence(noise, faces, 25.0)
    with pytest.raises(InvalidInputError, match="accept this rig"):
        saved(tmp_path, sequence)
    path = tmp_path / "forced.glb"
    meshreel.save(sequence, path, rig=2, force=True, notes=notes)
    assert any(note.startswith("the rig exceeds its error bounds") for note in notes)


def test_influences_stay_in_their_columns():
    joints = np.array([[3, 5, 0, 0], [5, 3, 0, 0], [5, 8, 3, 0]], np.uint8)
    weights = np.array([[200, 55, 0, 0], [200, 55, 0, 0], [100, 100, 55, 0]], np.uint8)
    aligned, shares = align_influences(joints, weights)
    assert aligned.tolist() == [[3, 5, 0, 0], [3, 5, 0, 0], [3, 5, 8, 0]]
    assert shares.tolist() == [[200, 55, 0, 0], [55, 200, 0, 0], [55, 100, 100, 0]]
