"""Meshes of USD files in world space, at the time codes of frames."""

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.usd.sampling import (
    Samples,
    distinct_codes,
    even_codes,
    even_interval,
    frame_grid,
    sampled_codes,
)
from samples.opening import open_source
from samples.usd import POINTS, QUAD, mesh

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
MOVING = """point3f[] points.timeSamples = {
    %s: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
    %s: [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    %s: [(0, 0, 2), (1, 0, 2), (1, 1, 2), (0, 1, 2)],
}"""
TRANSLATED = 'uniform token[] xformOpOrder = ["xformOp:translate"]'


def test_load_reads_points_at_their_samples(stage_file):
    header = "timeCodesPerSecond = 30"
    loaded = load(stage_file(mesh(points=MOVING % (1001, 1002, 1003)), header))
    expected = (
        SQUARE + np.array([0, 0, 1], np.float32) * np.arange(3, dtype=np.float32)[:, None, None]
    )
    assert loaded.vertices.dtype == np.float32
    np.testing.assert_array_equal(loaded.vertices, expected)
    np.testing.assert_array_equal(loaded.surface.face_sizes, [4])
    np.testing.assert_array_equal(loaded.faces, [[0, 1, 2], [0, 2, 3]])
    assert (loaded.fps, loaded.start_s, loaded.name) == (30.0, 1001 / 30, "m")


@pytest.mark.parametrize(
    ("codes", "header", "fps", "start_s"),
    [
        ((0, 1, 2), "", 24.0, 0.0),
        ((0, 2, 4), "timeCodesPerSecond = 48", 24.0, 0.0),
        ((1, 2, 3), "timeCodesPerSecond = 29.97", 29.97, 1 / 29.97),
        ((10, 11, 12), "timeCodesPerSecond = 1000", 1000.0, 0.01),
        ((250, 500, 750), "timeCodesPerSecond = 6000", 24.0, 250 / 6000),
        ((0, 1, 2), "framesPerSecond = 12", 12.0, 0.0),
        ((0, 1, 2), "framesPerSecond = 12\ntimeCodesPerSecond = 24", 24.0, 0.0),
    ],
)
def test_load_derives_the_frame_rate_from_even_samples(stage_file, codes, header, fps, start_s):
    loaded = load(stage_file(mesh(points=MOVING % codes), header))
    assert (loaded.fps, loaded.start_s, loaded.n_frames) == (fps, start_s, 3)


@pytest.mark.parametrize(
    ("key", "rate"),
    [("timeCodesPerSecond", rate) for rate in ("0", "-24", "nan", "inf", "1e-300", "1e7")]
    + [("framesPerSecond", rate) for rate in ("inf", "1e7")],
)
def test_load_rejects_invalid_rates(stage_file, key, rate):
    stage_file(mesh(points=MOVING % (0, 1, 2)), "timeCodesPerSecond = 24", name="layer.usda")
    path = stage_file("", f"subLayers = [@./layer.usda@]\n{key} = {rate}")
    with pytest.raises(FormatError, match=f"a.usda: has .* as {key}; expected 0.001 to 1e"):
        load(path)


IN_A_VARIANT = """def "m" (
    prepend variantSets = "v"
) {
    variantSet "v" = {
        "chosen" { }
        "other" (references = @./layer.usda@</m>) { }
    }
}"""


@pytest.mark.parametrize(
    ("header", "body"),
    [
        ("subLayers = [@./layer.usda@]", ""),
        ("", 'def "m" (references = @./layer.usda@</m>) { }'),
        ("", 'def "m" (payload = @layer.usda@</m>) { }'),
        ("", IN_A_VARIANT),
    ],
)
def test_load_rejects_invalid_rates_of_referenced_layers(stage_file, header, body):
    stage_file(mesh(points=MOVING % (0, 1, 2)), "timeCodesPerSecond = 0", name="layer.usda")
    with pytest.raises(FormatError, match=r"has 0 as timeCodesPerSecond; .* \(layer.usda\)"):
        load(stage_file(body, header))


def test_load_fills_frames_between_sparse_samples(stage_file, notes):
    loaded = load(stage_file(mesh(points=MOVING % (1, 2, 4))), notes=notes)
    np.testing.assert_array_equal(loaded.vertices[:, 0, 2], [0, 1, 1.5, 2])
    assert any("3 samples" in note and "4 frames" in note for note in notes)


def test_load_returns_one_frame_without_a_rate_for_a_static_mesh(stage_file):
    loaded = load(stage_file(mesh(), "timeCodesPerSecond = 30"))
    assert (loaded.n_frames, loaded.fps, loaded.start_s) == (1, 0.0, 0.0)


def test_load_bakes_animated_transforms_of_ancestors(stage_file):
    body = f"""def Xform "a" {{
        double3 xformOp:translate.timeSamples = {{ 1: (0, 0, 0), 2: (0.1, 0, 0), 3: (0.2, 0, 0) }}
        {TRANSLATED}
        def Xform "b" {{
            double xformOp:rotateZ = 90
            uniform token[] xformOpOrder = ["xformOp:rotateZ"]
            {mesh()}
        }}
    }}"""
    loaded = load(stage_file(body))
    rotated = np.stack([-SQUARE[:, 1], SQUARE[:, 0], SQUARE[:, 2]], axis=1).astype(np.float64)
    expected = [rotated + np.array([shift, 0, 0]) for shift in (0.0, 0.1, 0.2)]
    assert loaded.vertices.dtype == np.float32
    np.testing.assert_allclose(loaded.vertices, expected, rtol=0, atol=1e-7)
    assert (loaded.fps, loaded.start_s) == (24.0, 1 / 24)


ROTATING = """double xformOp:rotateZ.timeSamples = { 0: 0, 6: 90 }
    uniform token[] xformOpOrder = ["xformOp:rotateZ"]"""


@pytest.mark.parametrize(
    ("header", "fps", "n_frames", "rate"),
    [
        ("", None, 7, 24.0),
        ("timeCodesPerSecond = 60\nframesPerSecond = 1e-4", None, 7, 60.0),
        ("timeCodesPerSecond = 60\nframesPerSecond = 30", None, 4, 30.0),
        ("timeCodesPerSecond = 240", None, 2, 40.0),
        ("", 12, 4, 12.0),
        ("", 96, 25, 96.0),
    ],
)
def test_load_interpolates_rotations_between_keys(stage_file, header, fps, n_frames, rate):
    path = stage_file(f'def Xform "a" {{ {ROTATING}\n{mesh()} }}', header)
    loaded = load(path, fps=fps)
    angles = np.radians(np.linspace(0, 90, n_frames))
    corner = np.stack([np.cos(angles), np.sin(angles), np.zeros(n_frames)], axis=1)
    assert (loaded.n_frames, loaded.fps) == (n_frames, rate)
    np.testing.assert_allclose(loaded.vertices[:, 1], corner, rtol=0, atol=1e-7)


@pytest.mark.parametrize("fps", [None, 50])
def test_load_keeps_the_frames_of_a_cache_below_an_animated_transform(stage_file, fps):
    path = stage_file(mesh(points=MOVING % (0, 3, 6), more=ROTATING))
    loaded = load(path, fps=fps)
    assert (loaded.n_frames, loaded.fps) == (3, fps or 8.0)
    np.testing.assert_allclose(loaded.vertices[1, 1], [0.5**0.5, 0.5**0.5, 1], rtol=0, atol=1e-7)


def test_load_respects_a_reset_of_the_transform_stack(stage_file):
    body = f"""def Xform "a" {{
        double3 xformOp:translate.timeSamples = {{ 1: (1, 0, 0), 2: (2, 0, 0) }}
        {TRANSLATED}
        def Xform "b" {{
            uniform token[] xformOpOrder = ["!resetXformStack!"]
            {mesh()}
        }}
    }}"""
    loaded = load(stage_file(body))
    np.testing.assert_array_equal(loaded.vertices, SQUARE[None])


def test_load_returns_float64_for_a_mesh_moved_far_from_the_origin(stage_file):
    body = mesh(more=f"double3 xformOp:translate = (4512345.25, 0.5, 0)\n{TRANSLATED}")
    loaded = load(stage_file(body))
    assert loaded.vertices.dtype == np.float64
    np.testing.assert_array_equal(loaded.vertices[0], SQUARE + np.array([4512345.25, 0.5, 0]))


@pytest.mark.parametrize(
    ("more", "is_reversed"),
    [
        ('uniform token orientation = "leftHanded"', True),
        (
            'float3 xformOp:scale = (-1, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]',
            True,
        ),
        (
            'uniform token orientation = "leftHanded"\nfloat3 xformOp:scale = (-1, 1, 1)\n'
            'uniform token[] xformOpOrder = ["xformOp:scale"]',
            False,
        ),
    ],
)
def test_load_reverses_clockwise_faces(stage_file, more, is_reversed):
    uv = """texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "faceVarying"
    )"""
    loaded = load(stage_file(mesh(more=f"{more}\n{uv}")))
    order = [0, 3, 2, 1] if is_reversed else [0, 1, 2, 3]
    np.testing.assert_array_equal(loaded.faces, [order[:3], [order[0], *order[2:]]])
    np.testing.assert_array_equal(loaded.surface.attributes[0].per_item(), SQUARE[order, :2])


def test_load_selects_and_merges_several_meshes(stage_file):
    path = stage_file(f'def Xform "r" {{ {mesh(points=MOVING % (0, 1, 2))} {mesh(name="n")} }}')
    with pytest.raises(InvalidInputError, match="holds 2 meshes: /r/m, /r/n"):
        load(path)
    assert (load(path, object="n").n_frames, load(path, object="/r/m").n_frames) == (1, 3)
    merged = load(path, merge=True)
    assert [part.name for part in merged.surface.parts] == ["/r/m", "/r/n"]
    np.testing.assert_array_equal(merged.vertices[:, 4:], np.tile(SQUARE, (3, 1, 1)))


def test_load_names_samples_between_frames_that_it_leaves_out(stage_file, notes):
    keys = (f"{n / 4}: [(0, 0, {n}), (1, 0, 0), (0, 1, 0), (1, 1, 0)]," for n in (4, 5, 8, 9, 12))
    path = stage_file(mesh(points=f"point3f[] points.timeSamples = {{ {''.join(keys)} }}"))
    np.testing.assert_array_equal(load(path, notes=notes).vertices[:, 0, 2], [4, 8, 12])
    assert "left out: samples between frames, as for motion blur: /m (2 of 5)" in notes


def test_load_reads_instances_of_prims(stage_file):
    body = f"""class "proto" {{ {mesh(points=MOVING % (0, 1, 2))} }}
    def Xform "a" (instanceable = true
        references = </proto>) {{ }}
    def Xform "b" (instanceable = true
        references = </proto> (offset = 10)) {{
        double3 xformOp:translate = (0, 0, 5)
        {TRANSLATED}
    }}"""
    path = stage_file(body)
    first, second = load(path, object="/a/m"), load(path, object="/b/m")
    np.testing.assert_array_equal(second.vertices, first.vertices + np.float32([0, 0, 5]))
    assert (first.start_s, second.start_s) == (0.0, 10 / 24)


def test_load_applies_layer_offset_and_scale(stage_file):
    stage_file(mesh(points=MOVING % (1, 2, 3)), 'defaultPrim = "m"', name="layer.usda")
    body = 'def "x" (references = @layer.usda@ (offset = 0.1; scale = 2)) { }'
    loaded = load(stage_file(body, "timeCodesPerSecond = 24"))
    assert loaded.n_frames == 3
    assert loaded.fps == 12
    assert loaded.start_s == pytest.approx(2.1 / 24, abs=1e-12)
    np.testing.assert_array_equal(loaded.vertices[:, 0, 2], [0, 1, 2])


def test_load_reads_value_clips(stage_file):
    for number in (1, 2):
        stage_file(mesh(points=MOVING % (0, 1, 2)), 'defaultPrim = "m"', name=f"clip{number}.usda")
    stage_file('over "m" {\npoint3f[] points\n}', 'defaultPrim = "m"', name="manifest.usda")
    clips = """clips = { dictionary default = {
        asset[] assetPaths = [@./clip1.usda@, @./clip2.usda@]
        asset manifestAssetPath = @./manifest.usda@
        string primPath = "/m"
        double2[] active = [(0, 0), (3, 1)]
        double2[] times = [(0, 0), (2, 2), (3, 0), (5, 2)]
    } }"""
    loaded = load(stage_file(mesh(points="").replace('"m"', f'"m" ({clips})')))
    np.testing.assert_array_equal(loaded.vertices[:, 0, 2], [0, 1, 2, 0, 1, 2])


def test_load_leaves_out_meshes_that_are_not_rendered(stage_file, notes):
    body = mesh() + "".join(
        mesh(more=more, name=name)
        for name, more in {
            "proxy": 'uniform token purpose = "proxy"',
            "guide": 'uniform token purpose = "guide"',
            "unseen": 'token visibility = "invisible"',
            "blinking": 'token visibility.timeSamples = { 0: "invisible", 1: "invisible" }',
        }.items()
    )
    body += 'def Mesh "empty" { }\ndef Sphere "ball" { }\n'
    body += 'def BasisCurves "hair" { }\n'
    body += f'def PointInstancer "many" {{ {mesh(name="proto")} }}'
    assert load(stage_file(body), notes=notes).name == "m"
    assert notes[:5] == [
        "left out: BasisCurves prims: /hair",
        "left out: Mesh prims: /empty",
        "left out: PointInstancer prims: /many",
        "left out: Sphere prims: /ball",
        "left out: hidden meshes: /proxy (purpose proxy), /guide (purpose guide), /unseen, "
        "/blinking",
    ]


def test_hidden_meshes_are_read_if_all_are(stage_file, notes):
    body = mesh(more='token visibility = "invisible"')
    assert load(stage_file(body), notes=notes).name == "m"
    assert "all meshes are hidden; read as if they were visible" in notes


@pytest.mark.parametrize(
    ("body", "contents"),
    [
        ("", "contains no mesh"),
        ('def Xform "a" { }', "contains no mesh"),
        (
            'def BasisCurves "a" { }\ndef BasisCurves "b" { }',
            "contains no mesh, only 2 BasisCurves",
        ),
    ],
)
def test_load_lists_the_contents_of_a_file_without_meshes(stage_file, body, contents):
    with pytest.raises(FormatError, match=f"a.usda: {contents}"):
        load(stage_file(body))


def test_load_notes_missing_references(stage_file, notes):
    load(stage_file(mesh() + 'def "x" (references = @gone.usda@) { }'), notes=notes)
    assert "Could not open asset @gone.usda@" in notes[0]


def test_load_notes_axes_and_units_that_differ(stage_file, notes):
    load(stage_file(mesh(), 'upAxis = "Z"\nmetersPerUnit = 0.01'), notes=notes)
    assert notes[0] == (
        "positions stay in the axes and units of the file, where z points up, a unit is 0.01 m"
    )
    notes.clear()
    load(stage_file(mesh(), 'upAxis = "Y"\nmetersPerUnit = 1', name="b.usda"), notes=notes)
    assert not any("axes" in note for note in notes)


EMPTY = """point3f[] points.timeSamples = { 0: [], 1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }
    int[] faceVertexCounts.timeSamples = { 0: [], 1: [3] }
    int[] faceVertexIndices.timeSamples = { 0: [], 1: [0, 1, 2] }"""


def test_load_names_a_mesh_that_is_empty_in_the_first_frame(stage_file):
    more = f"double3 xformOp:translate = (5, 0, 0)\n{TRANSLATED}"
    path = stage_file(mesh(more, points=EMPTY, faces=""))
    with pytest.raises(FormatError, match="mesh /m has 0 vertices and 0 faces at time code 0"):
        load(path)


def test_load_rereads_a_file_that_has_changed(stage_file):
    path = stage_file(mesh(points=MOVING % (0, 1, 2)))
    source = open_source(path)
    assert source.n_frames == 3
    stage_file(mesh())
    assert load(path).n_frames == 1


def test_load_reads_splines_of_transforms(stage_file):
    from pxr import Usd

    if not hasattr(Usd.Attribute, "HasSpline"):
        pytest.skip("this usd-core has no splines")
    more = """double xformOp:translateX.spline = { 1: 0; post held, 5: 4; post held, }
    uniform token[] xformOpOrder = ["xformOp:translateX"]"""
    loaded = load(stage_file(mesh(more=more.replace("post held", "post linear"))))
    np.testing.assert_array_equal(loaded.vertices[:, 0, 0], [0, 1, 2, 3, 4])


@pytest.mark.parametrize(
    ("operation", "number"),
    [
        ("translate", "inf"),
        ("translate", "nan"),
        ("scale", "inf"),
        ("scale", "nan"),
        ("scale", "1e308"),
    ],
)
def test_load_rejects_transforms_that_are_not_finite(stage_file, operation, number):
    more = f"""double3 xformOp:{operation} = ({number}, {number}, {number})
    uniform token[] xformOpOrder = ["xformOp:{operation}"]"""
    points = POINTS.replace("(1, 1, 0)", "(1e38, 1, 0)")
    with pytest.raises(InvalidInputError, match="every position must be finite"):
        load(stage_file(mesh(more, points=points)))


@pytest.mark.parametrize(
    ("points", "faces", "message"),
    [
        ('string[] points = ["a", "b"]', QUAD, "mesh /m has points of a type other than point3f"),
        (POINTS, QUAD.replace("int[]", "float[]", 1), "mesh /m has faces of a type other than int"),
        (
            POINTS,
            'int[] faceVertexCounts = [4]\ntoken faceVertexIndices = "x"',
            "mesh /m has faces",
        ),
        (POINTS, QUAD.replace("[4]", "[5]"), "has 4 faceVertexIndices .* need 5"),
        (POINTS, QUAD.replace("[4]", "[-4]"), "faceVertexCounts need -4"),
        (POINTS, QUAD.replace("[4]", "[2, 2]"), "face 0: a face needs at least three corners"),
        (POINTS, QUAD.replace("3]", "4]"), "uses vertex 4; indices must be in 0..3"),
        ("point3f[] points = []", QUAD, "has 0 vertices and 1 face"),
        (POINTS, "int[] faceVertexCounts = [4]", "has no faceVertexIndices"),
        ("point3f[] points = [(nan, 0, 0), (1, 0, 0), (0, 0, 0), (0, 0, 0)]", QUAD, "be finite"),
        (POINTS.replace("(1, 1, 0)", "(1e39, 1, 0)"), QUAD, "be finite"),
        ("point3f[] points.timeSamples = { 0: None, 1: [(0, 0, 0)] }", QUAD, "has no points at"),
        ("point3f[] points.timeSamples = { 0: [], 1e30: [] }", QUAD, "expected -"),
    ],
)
def test_errors_of_invalid_meshes_name_the_mesh(stage_file, capfd, points, faces, message):
    with pytest.raises((FormatError, InvalidInputError), match=f"a.usda: .*{message}"):
        load(stage_file(mesh(points=points, faces=faces)))
    assert capfd.readouterr().err == ""


MOVED = """def Xform "x" {
double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), %g: (6, 0, 0) }
%s
%s
}"""


@pytest.mark.parametrize(("last", "fps"), [(7.5, None), (6, 30)])
def test_load_keeps_the_final_pose_between_two_frames(stage_file, last, fps, notes):
    path = stage_file(MOVED % (last, TRANSLATED, mesh()), "timeCodesPerSecond = 24")
    loaded = load(path, fps=fps, notes=notes)
    assert (loaded.n_frames, loaded.fps) == (9, fps or 24)
    assert loaded.vertices[-1, 0].tolist() == [6, 0, 0]
    np.testing.assert_allclose(np.diff(loaded.vertices[:8, 0, 0]), 0.8, rtol=1e-5)
    shown = 8 if fps is None else 6.4
    final = f"/x/m (time code {last:g}, shown at {shown:g})"
    assert f"the last frame shows the final pose, which is earlier: {final}" in notes


def frames(stored, keys, frame_interval=1.0, origin=None):
    """Return the frames of a mesh with these samples; the default origin is the first sample."""
    result = Samples(np.array(stored, np.float64), np.array(keys, np.float64))
    return result.frames(frame_interval, result.all[0] if origin is None else origin)


@pytest.mark.parametrize("code", [np.inf, np.nan, -1e10])
def test_distinct_codes_are_sorted_and_neither_huge_nor_invalid(code):
    np.testing.assert_array_equal(distinct_codes([3.0, 1.0, 2.0, 2.0 + 1e-9, 1.0]), [1, 2, 3])
    with pytest.raises(FormatError, match="expected -"):
        distinct_codes([1.0, code, 2.0])


def test_even_interval_tolerates_rounding_errors():
    assert even_interval(np.arange(100.0) * (1 / 3)) == pytest.approx(1 / 3, abs=1e-12)
    assert even_interval(1001 + np.arange(100.0) * 1.0000000001) == 1
    assert even_interval(np.array([1.0, 2, 4])) == 0
    assert even_interval(np.array([5.0])) == 0


@pytest.mark.parametrize(
    ("samples", "frame_interval", "expected"),
    [
        *((even, 1, even) for even in ([], [4], [1, 2, 3], [0, 2.5, 5], [10.25, 10.5, 10.75])),
        *((uneven, 1, uneven) for uneven in ([0, 33, 67, 100], [0, 1, 1000], [0.1, 0.4, 1.1])),
        ([0.75, 1, 1.25, 1.75, 2, 2.25, 2.75, 3, 3.25], 1, [1, 2, 3]),
        ([1, 1.25, 1.75, 2, 2.25, 2.75, 3], 1, [1, 2, 3]),
        ([0.75, 1, 1.25, 1.75, 2, 2.25], 1, [1, 2]),
        ([40, 50, 60, 90, 100, 110, 140, 150, 160], 50, [50, 100, 150]),
        *((uneven, 1, uneven) for uneven in ([0, 0.1, 0.3, 1], [0, 0.25, 1, 1.25, 2, 3])),
        ([0, 0.1, 1, 1.1, 2], 1 / 24, [0, 0.1, 1, 1.1, 2]),  # codes are seconds
        ([0, 1, 2, 2.5], 0.5, [0, 0.5, 1, 1.5, 2, 2.5]),
        ([0, 1, 2, 3.3], 1, [0, 1, 2, 3.3]),
        ([2, 4, 6, 12], 1, [2, 4, 6, 8, 10, 12]),  # with a gap
        ([0.25, 0.75, 1.75], 1, [0.25, 0.75, 1.75]),  # between the frames of the stage
    ],
)
def test_even_codes_are_all_or_the_main_samples_with_gaps_filled(samples, frame_interval, expected):
    np.testing.assert_array_equal(
        even_codes(np.array(samples, np.float64), frame_interval), expected
    )


@pytest.mark.parametrize(
    ("samples", "frame_interval", "origin", "expected"),
    [
        ([1, 5], 1, 1, [1, 2, 3, 4, 5]),
        ([0, 7, 10], 2.5, 0, [0, 2.5, 5, 7.5, 10]),
        ([6, 12], 2.5, 0, [5, 7.5, 10, 12.5]),  # aligned to the origin
        *((dense, 1, dense[0], dense) for dense in ([3], [1, 2, 3], [0, 0.5, 1])),
    ],
)
def test_sampled_codes_are_all_frames_between_sparse_keys(
    samples, frame_interval, origin, expected
):
    result = sampled_codes(np.array(samples, np.float64), frame_interval, origin)
    np.testing.assert_array_equal(result, expected)


SPARSE = ([], [0, 30, 60]), ([5], [0, 60]), ([0, 60], [0, 60]), ([0, 40], [20, 60])
CACHE = np.arange(0, 41, 2)


@pytest.mark.parametrize(
    ("stored", "keys", "expected"),
    [
        *((stored, keys, np.arange(61)) for stored, keys in SPARSE),
        *((stored, [], stored) for stored in ([0, 60], [0, 10, 20], [3, 33, 66], [0, 2, 4])),
        *((CACHE, keys, CACHE) for keys in ([0, 40], [10, 30], [0, 1, 2], [1, 39], [8, 12.5, 40])),
        (np.arange(10, 21, 2), [5, 27], np.arange(4, 29, 2)),  # in the range of keys
    ],
)
def test_frames_are_the_samples_of_points_or_those_of_the_stage(stored, keys, expected):
    np.testing.assert_array_equal(frames(stored, keys), expected)


@pytest.mark.parametrize("last", [3.3, 3 + 1e-5, 4 - 1e-9, 4.0])
def test_frame_grid_has_one_frame_after_a_last_sample_between_frames(last):
    np.testing.assert_array_equal(frame_grid(1.0, last, 1.0), [1, 2, 3, 4])


def test_frame_grid_is_exact_for_fractional_intervals():
    result = frame_grid(1001.0, 1101.0, 24 / 30)
    assert len(result) == 126
    np.testing.assert_array_equal(result[::5], np.arange(1001, 1102, 4))


@pytest.mark.parametrize("last", [1e18, 1e308])
def test_frame_grid_rejects_too_many_frames(last):
    with pytest.raises(FormatError, match="the limit is 1000000"):
        frame_grid(-1e308 if last > 1e300 else 0.0, last, 1.0)
