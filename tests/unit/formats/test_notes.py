import pickle

import numpy as np
import pytest

from meshreel.errors import Keyword, Message
from meshreel.formats.load import load
from meshreel.model.notes import Note, NoteKind, listed
from meshreel.model.timing import UNTIMED
from meshreel.operations.save import save
from samples.gltf import TRIANGLE, Gltf
from samples.meshes import two_sheets, waving_grid
from samples.vtk_text import write_pvd


def test_note_on_something_left_out_is_added_once(notes):
    notes.result("read at 24 frames per second")
    notes.left_out("lights: key, rim")
    notes.left_out("lights: key, rim")
    assert notes == ["read at 24 frames per second", "left out: lights: key, rim"]


def test_long_lists_end_with_a_count():
    assert listed("abc", most=3) == "a, b, c"
    assert listed("abcde", most=3) == "a, b, c and 2 more"
    assert len(listed(["a" * 10**6])) < 1000


def test_note_lists_further_names_in_its_place(notes):
    notes.changed("before")
    notes.left_out("curves", ["a"])
    notes.changed("between")
    notes.left_out("curves", ["b", "a"])
    notes.list_names(NoteKind.CHANGED, "curves", [])
    assert notes == ["before", "left out: curves: a, b", "between"]


def test_note_knows_kind_and_subject_after_pickling():
    note = pickle.loads(pickle.dumps(Note(NoteKind.LEFT_OUT, "curves", ["/a", "/b"])))
    assert note == "left out: curves: /a, /b"
    assert (note.kind, note.contents) == (NoteKind.LEFT_OUT, "curves: /a, /b")
    assert note.subject == "curves"


@pytest.mark.parametrize("is_subject", [False, True])
def test_note_knows_its_keywords_after_pickling(is_subject):
    text = Message("read as 24 fps; set another with ", Keyword("fps"))
    content = {"subject": text} if is_subject else {"subject": "frame rate", "text": text}
    note = pickle.loads(pickle.dumps(Note(NoteKind.UNKNOWN, **content)))
    assert note == "read as 24 fps; set another with fps"
    assert note.naming(lambda keyword: f"--{keyword.name}") == text[:-3] + "--fps"


def test_notes_of_several_segments_become_one_when_only_details_differ(notes):
    for count in (3, 4):
        notes.changed("hard edges", f"kept {count} hard edges")
        notes.left_out("normals")
        notes.changed(f"read {count} frames")
    notes.combine()
    assert notes == [
        "kept 3 hard edges; other segments similarly",
        "left out: normals",
        "read 3 frames",
        "read 4 frames",
    ]


OBJ = "v 0 0 0{a}\nv 1 0 0{a}\nv 0 1 0{a}\nvt {u} 0\nvt 1 0\nf 1/1 2/2 3/1\n"
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
{properties}element face 1
property list uchar int vertex_indices
{face_properties}{elements}end_header
"""
LEGACY = """# vtk DataFile Version 3.0
a title
ASCII
DATASET POLYDATA
POINTS 3 float
0 0 0 1 0 0 0 1 0
POLYGONS 1 4
3 0 1 2
{data}"""
XML = """<VTKFile type="PolyData" version="1.0"><PolyData>{field}
<Piece NumberOfPoints="3" NumberOfPolys="1">{data}
<Points><DataArray type="Float32" NumberOfComponents="3">0 0 0 1 0 0 0 1 0</DataArray></Points>
<Polys><DataArray type="Int64" Name="connectivity">0 1 2</DataArray>
<DataArray type="Int64" Name="offsets">3</DataArray></Polys></Piece></PolyData></VTKFile>"""


def left_out(source, **options):
    """Load a file; return its notes on omitted data, without their common prefix."""
    notes = []
    load(source, notes=notes, **options)
    return [note.removeprefix("left out: ") for note in notes if note.startswith("left out: ")]


def stored(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


TRACKS = "tracks are numbers of shape (2, N) or (2, N, C), C up to 256, for 99 vertices, 160 faces"


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
@pytest.mark.parametrize(
    ("arrays", "noted"),
    [
        (
            {"fps": 24.0, "pressure": np.zeros(9), "labels": np.zeros(3)},
            f"arrays: pressure, labels; {TRACKS} and 480 corners",
        ),
        (
            {"cell_types": 10, "group_0_labels": ["a"]},
            "arrays that no other refers to: cell_types, group_0_labels",
        ),
    ],
)
def test_other_npz_arrays_are_noted(tmp_path, write, arrays, noted):
    grid = waving_grid(2)
    write(tmp_path / "a.npz", vertices=grid.vertices, faces=grid.faces, **arrays)
    assert left_out(tmp_path / "a.npz") == [noted]


def test_files_of_meshreel_leave_nothing_out(tmp_path):
    for extension in (".npz", ".h5", ".vtkhdf", ".reel"):
        save(two_sheets(), tmp_path / f"a{extension}")
        assert left_out(tmp_path / f"a{extension}") == []


def test_other_hdf_datasets_are_noted(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["faces"] = waving_grid().faces
        file["scans/one"] = waving_grid().vertices
        file["scans/two"] = waving_grid().vertices
        file["weights"] = np.zeros(4)
        file.attrs["author"], file["scans/one"].attrs["unit"] = "lab", "mm"
    said = left_out(tmp_path / "a.h5", dataset="scans/one")
    assert said == ["attributes: author of the file, unit of scans/one", "datasets: weights"]


def test_vtkhdf_groups_and_field_data_are_noted(tmp_path):
    h5py = pytest.importorskip("h5py")
    save(waving_grid(), tmp_path / "a.vtkhdf")
    with h5py.File(tmp_path / "a.vtkhdf", "a") as file:
        file["VTKHDF/FieldData/mass"] = np.zeros(2)
        file["VTKHDF/PointData/heat"] = np.zeros(99)
        file.create_group("notes of the lab")
    assert left_out(tmp_path / "a.vtkhdf") == [
        "groups: notes of the lab",
        "array 'heat', which has 99 rows; step 1 needs 99 from row 99 on",
        "field data: mass",
    ]


PLAIN_OBJ = OBJ.format(a="", u=0)
NORMALS = "normals, which programs compute"
XML_ARRAY = '<DataArray type="Float32" Name="{}">{}</DataArray>'
HEAT = f"<PointData>{XML_ARRAY.format('heat', '1 2 3')}</PointData>"
PIECE = XML[XML.index("<Piece") : XML.index("</Piece>") + 8].format(data="")
XDMF = """<Xdmf><Domain><Grid>
<Topology TopologyType="Triangle" NumberOfElements="1"><DataItem Dimensions="1 3"
NumberType="Int">0 1 2</DataItem></Topology>
<Geometry GeometryType="XYZ"><DataItem Dimensions="3 3">0 0 0 1 0 0 0 1 0</DataItem></Geometry>
<Attribute Name="total" Center="Grid"><DataItem Dimensions="1">4</DataItem></Attribute>
<Set Name="wall"/></Grid></Domain></Xdmf>"""


def ply(elements, face_properties="", values="", header=""):
    """Return a PLY file of a triangle with normals, and further elements, lines and values."""
    text = PLY.format(
        properties=f"property float nx\n{header}",
        face_properties=face_properties,
        elements=f"element {elements}\n",
    )
    return f"{text}0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2{values}\n"


OTHERS = {
    "plain": ("a.obj", PLAIN_OBJ, []),
    "lines": ("a.obj", f"{PLAIN_OBJ}l 0 1\n", ["lines"]),
    "normals and points": (
        "a.obj",
        f"mtllib a.mtl\nvn 0 0 1\nvn 0 0 1\ns 1\n{PLAIN_OBJ}s off\np 1\np 2\n",
        [NORMALS, "points", "material libraries: a.mtl"],
    ),
    "statements": (
        "a.obj",
        f"# made by hand\nvt 0 0 0.5\nvp 0.1 1\nlod 3\n{PLAIN_OBJ}v 5 0 0 0.5\nf 1/1 2/1 3/1\n",
        [
            "statements: vp, lod",
            "weights, or colors of some vertices",
            "third texture coordinates",
        ],
    ),
    "smoothing": (
        "a.obj",
        f"s 1\n{PLAIN_OBJ}s 2\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf -3 -2 -1\n",
        ["smoothing groups, which share no edges"],
    ),
    "unused uv": (
        "a.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1 2 3\n",
        ["texture coordinates of no face"],
    ),
    "header": (
        "a.ply",
        ply("edge 0", header="obj_info 3\ncomment TextureFile a.png\n"),
        ["lines of the header: line 8 'obj_info 3'", "texture images: a.png", NORMALS],
    ),
    "elements": (
        "a.ply",
        ply("edge 1\nproperty int a", "property list uchar int flags\n", " 1 7\n5"),
        [NORMALS, "lists: face.flags", "elements: edge"],
    ),
    "solid": (
        "a.stl",
        "solid a part\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        "vertex 0 1 0\nendloop\nendfacet\nendsolid\n",
        ["names of solids: a part"],
    ),
    "numbers": (
        "a.off",
        "OFF\n3 1 0\n0 0 0 7\n1 0 0\n0 1 0\n3 0 1 2\n",
        ["further numbers of vertices"],
    ),
    "color": (
        "a.off",
        "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2 4\n",
        [NORMALS, "face colors, which not all faces have as three or four numbers"],
    ),
    "color tables": (
        "a.vtk",
        LEGACY.format(
            data="FIELD all 1\nmass 1 1 float\n4\nPOINT_DATA 3\nSCALARS heat float 1\n"
            "LOOKUP_TABLE jet\n0 1 2\nLOOKUP_TABLE jet 1\n0 0 0 1\n"
        ),
        ["field data: mass", "color tables: jet"],
    ),
    "components": (
        "a.vtk",
        LEGACY.format(
            data="POINT_DATA 3\nVECTORS u float\n1 2 3 4 5 6 7 8 9\nMETADATA\nCOMPONENT_NAMES\n"
            "u%20x\n\nuz\nINFORMATION 0\n\nSCALARS heat float\n1 2 3\n"
        ),
        ["names of components: u (u x, , uz)"],
    ),
    "field data and text": (
        "a.vtp",
        XML.format(
            field='<FieldData><DataArray type="Float64" Name="TimeValue">1</DataArray>'
            f"{XML_ARRAY.format('mass', 4)}</FieldData>",
            data='<PointData><Array type="String" Name="tag">65 0 0 66 0</Array>'
            f"{XML_ARRAY.format('heat', '1 2 3')}</PointData>".replace(
                ">1", ' ComponentName0="K">1'
            ),
        ),
        [
            "names of components: heat (K)",
            "field data: mass",
            "fields of text, or with more than 256 components: tag",
        ],
    ),
    "another piece": (
        "a.vtp",
        XML.format(field="", data=HEAT).replace("</Piece>", f"</Piece>{PIECE}"),
        ["values of pieces that lack an array, NaN there: heat"],
    ),
    "sets": ("a.xdmf", XDMF, ["data of neither nodes nor cells: total", "sets: wall"]),
}


@pytest.mark.every_case
@pytest.mark.parametrize(("name", "text", "noted"), OTHERS.values(), ids=OTHERS)
def test_other_contents_of_text_files_are_noted(tmp_path, name, text, noted):
    if name.endswith(".xdmf"):
        pytest.importorskip("h5py")
    assert left_out(stored(tmp_path, name, text)) == noted


def test_values_of_pieces_without_an_array_are_nan(tmp_path):
    text = XML.format(field="", data=HEAT).replace("<Piece", f"{PIECE}<Piece")
    heat = load(stored(tmp_path, "a.vtp", text)).tracks["heat"].values
    np.testing.assert_array_equal(heat.ravel(), [np.nan] * 3 + [1, 2, 3])


TIMED_XML = XML.format(
    field=f"<FieldData>{XML_ARRAY.format('TimeValue', '{}')}</FieldData>", data=""
)
TIMED = {"vtp": TIMED_XML, "vtk": LEGACY.format(data="FIELD f 1\nTimeValue 1 1 double\n{}\n")}


@pytest.mark.parametrize("extension", TIMED)
@pytest.mark.parametrize(
    ("times", "fault"),
    [
        ([2, 2.25, 3], None),
        ([3.5], None),
        ([0, 1, 1], "do not ascend"),
        ([0, "nan", 2], "do not ascend"),
        ([0, None, 2], "only 2 of 3 files have"),
    ],
)
def test_times_of_frame_files_are_read_if_they_ascend(tmp_path, extension, times, fault):
    for number, time in enumerate(times):
        text = TIMED[extension].format(0 if time is None else time)
        text = text if time is not None else text.replace("TimeValue", "mass")
        stored(tmp_path, f"f_{number}.{extension}", text)
    noted = [note for note in left_out(tmp_path) if "mass" not in note]
    assert noted == ([] if fault is None else [f"times of files, which {fault}"])
    sequence = load(tmp_path)
    if fault is None:
        assert sequence.timing.seconds(len(times)).tolist() == times
    else:
        assert sequence.timing == UNTIMED


def test_frame_rate_replaces_times_of_frame_files(tmp_path):
    for time in (0, 1, 5):
        stored(tmp_path, f"f_{time}.vtp", TIMED_XML.format(time))
    assert load(tmp_path, fps=4).timing.times.tolist() == [0, 0.25, 1.25]


COFF = "COFF\n3 1 0\n0 0 0 {0}\n1 0 0 {0}\n0 1 0 {0}\n3 0 1 2\n"
CHANGES = "changes over time, kept as in the first frame"


@pytest.mark.parametrize(
    ("extension", "texts", "noted"),
    [
        ("obj", [f"{PLAIN_OBJ}\np 1", f"{PLAIN_OBJ}\np 1\nvp 0 1"], ["points", "statements: vp"]),
        (
            "obj",
            [PLAIN_OBJ.replace("f 1/1", f"usemtl m{number}\nf 1/1") for number in range(3)],
            [f"{CHANGES}: material"],
        ),
        ("off", [COFF.format(f"{red} 0 0 255") for red in range(3)], [f"{CHANGES}: color"]),
        ("obj", [OBJ.format(a=" 0 0 1", u=0)] * 4, []),
    ],
)
def test_contents_of_later_frames_are_noted(tmp_path, extension, texts, noted):
    for number, text in enumerate(texts):
        stored(tmp_path, f"f_{number}.{extension}", text)
    assert left_out(tmp_path) == noted


def test_stl_spare_bytes_are_noted(tmp_path):
    save(waving_grid(1), tmp_path / "a.stl")
    data = bytearray((tmp_path / "a.stl").read_bytes())
    data[80 + 4 + 48] = 31
    (tmp_path / "a.stl").write_bytes(data)
    assert left_out(tmp_path / "a.stl") == ["spare bytes of triangles, such as colors"]


def test_wide_arrays_of_a_collection_are_noted(tmp_path):
    wide = " ".join(["1"] * 51)
    data = f'<PointData><DataArray type="Int32" Name="wide" NumberOfComponents="17">{wide}'
    data += "</DataArray></PointData>"
    stored(tmp_path, "a.vtp", XML.format(field="", data=data))
    said = left_out(write_pvd(tmp_path, ['timestep="0" file="a.vtp"']))
    assert said == ["arrays of text, or with more than 16 components: wide"]


def test_everything_in_gltf_that_is_not_read_is_noted(tmp_path):
    file = Gltf()
    values = {"NORMAL": file.accessor(TRIANGLE), "CUSTOM": file.accessor(TRIANGLE)}
    mesh = file.mesh(TRIANGLE, attributes=values)
    primitives = file.json["meshes"][mesh]["primitives"]
    primitives[0]["targets"] = [{"TANGENT": 0}]
    primitives[0]["material"] = file.add(
        "materials", name="skin", extensions={"KHR_materials_ior": {}}, emissive=1
    )
    primitives.append({"attributes": {}})
    file.node(mesh=mesh, extras={"weight": 3}, name="m")
    file.node(camera=0)
    file.node(extensions={"KHR_lights_punctual": {"light": 0}})
    file.node(name="locator")
    file.add("materials", name="unused")
    file.add("cameras", type="perspective")
    file.json["extensions"] = {"EXT_other": 1}
    file.json["asset"] |= {"copyright": "us", "generator": "this test"}
    assert left_out(file.save(tmp_path / "a.glb")) == [
        "primitives without positions: 1 of 2 primitives of mesh 0",
        "EXT_other: the file",
        "cameras: node 1, camera 0",
        "copyright: the file",
        "lights: node 2",
        "other materials: unused",
        "other nodes: locator",
        "normals, which programs compute",
        "CUSTOM: mesh 0",
        "KHR_materials_ior: skin",
        "emissive: skin",
        "extras: m (weight)",
        "tangents, which programs compute: mesh 0",
    ]


USD = """#usda 1.0
(
  customLayerData = { string creator = "us" }
)
def Xform "w" (
  variants = { string size = "big" }
  prepend variantSets = "size"
) {
double3 xformOp:translate = (0, 0, 0)
uniform token[] xformOpOrder = ["xformOp:translate"]
float primvars:mass = 7
string shot = "12"
def Mesh "m" {
  point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
  uniform token subdivisionScheme = "none"
  int[] faceVertexCounts = [3]
  int[] faceVertexIndices = [0, 1, 2]
  normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1)]
  vector3f[] velocities = [(0, 0, 1), (0, 0, 1), (0, 0, 1)]
  string primvars:tag = "hero" (interpolation = "constant")
  string[] primvars:part = ["a", "b", "c"] (interpolation = "vertex")
}
def Camera "eye" { }
def DistantLight "sun" { }
def Mesh "off" (active = false) { }
def Xform "pivot" {
double3 xformOp:translate = (1, 0, 0)
}
variantSet "size" = { "big" { } "small" { } }
}
over "gone" { }
"""


def test_unsupported_usd_prims_and_primvars_are_noted(tmp_path):
    pytest.importorskip("pxr")
    assert left_out(stored(tmp_path, "a.usda", USD)) == [
        "Camera prims: /w/eye",
        "DistantLight prims: /w/sun",
        "inactive or undefined prims: /gone, /w/off",
        "metadata: customLayerData",
        "variants that are not selected: /w{size=small}",
        "normals, which programs compute",
        "data with a single sample, which cannot be a track: velocities",
        "other properties: shot",
        "primvars for a whole mesh, or that do not fit its faces: mass, part, tag",
    ]


def test_changing_usd_subsets_are_noted(tmp_path):
    pytest.importorskip("pxr")
    subset = '  def GeomSubset "s" { int[] indices.timeSamples = { 0: [0], 1: [] }\n}\n}\n'
    text = "#usda 1.0\n" + USD[USD.index("def Mesh") : USD.index("  normal3f")] + subset
    assert left_out(stored(tmp_path, "a.usda", text)) == [
        "changes over time, kept as in the first frame: /m/s"
    ]


def test_other_alembic_objects_are_noted(tmp_path):
    from samples import alembic as sample  # skips the test if the library is not installed

    top = sample.archive(tmp_path / "a.abc").getTop()
    group = sample.add_transform(top, "group", [])
    mesh = sample.add_mesh(group, "m", [sample.POINTS])
    sample.Abc.OInt32Property(group.getSchema().getUserProperties(), "shot").setValue(7)
    kind = sample.AbcGeom.GeometryScope.kVertexScope
    scale = sample.AbcGeom.OFloatGeomParam(
        mesh.getSchema().getArbGeomParams(), "scale", False, kind, 1
    )
    sample_of_three = sample.AbcGeom.OFloatGeomParamSample()
    sample_of_three.setVals(sample.imath.FloatArray(3))
    sample_of_three.setScope(kind)
    scale.set(sample_of_three)
    sample.AbcGeom.OCamera(top, "eye")
    sample.add_transform(top, "locator", [])
    del top, group, mesh, scale
    assert left_out(tmp_path / "a.abc") == [
        "cameras: /eye",
        "transforms without a mesh: /locator",
        "properties that do not fit the faces: scale",
        "user properties: shot",
    ]


def test_normals_of_a_topology_file_are_noted(tmp_path):
    save(waving_grid(), tmp_path / "a.pc2")
    with (tmp_path / "a.obj").open("a") as file:
        file.write("vn 0 0 1\n")
    assert left_out(tmp_path / "a.pc2") == ["normals, which programs compute"]


def test_fields_of_a_topology_file_are_noted(tmp_path):
    data = "POINT_DATA 3\nSCALARS heat float 1\nLOOKUP_TABLE default\n0 1 2\n"
    mesh = stored(tmp_path, "a.vtk", LEGACY.format(data=data))
    [cache, _] = save(load(mesh), tmp_path / "a.pc2")
    assert left_out(cache, topology=mesh) == ["fields: heat"]
