"""Test scenarios that run inside Blender; each returns arrays."""

import os
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Matrix
from meshreel_blender import player
from meshreel_blender.axes import matrix_to_file
from meshreel_blender.export_operator import ExportReel
from meshreel_blender.exporter import ExportChoices, export_reel
from meshreel_blender.panel import description


def positions_of(mesh):
    return np.array([vertex.co for vertex in mesh.vertices], np.float32)


def import_file(path, **options):
    bpy.ops.import_scene.meshreel(filepath=path, **options)
    return list(bpy.context.selected_objects)


def shapes(obj, frames):
    """Return own and evaluated positions at scene frames, each of shape (T, V, 3)."""
    own, evaluated = [], []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
        own.append(positions_of(obj.data))
        depsgraph = bpy.context.evaluated_depsgraph_get()
        evaluated.append(positions_of(obj.evaluated_get(depsgraph).data))
    return {"own": np.array(own), "evaluated": np.array(evaluated)}


def set_rate(fps, fps_base=1.0):
    bpy.context.scene.render.fps = fps
    bpy.context.scene.render.fps_base = fps_base


# Playing


def play(path, frames, fps=24, settings=None, **options):
    set_rate(fps)
    (obj,) = import_file(path, **options)
    for name, value in (settings or {}).items():
        setattr(obj.meshreel, name, value)
    return shapes(obj, frames)


def play_segments(path, frames, material=None):
    """Return positions and corners of each object at each frame; keys are "FRAME NAME what"."""
    set_rate(24)
    objects, result = import_file(path), {}
    if material:  # as a user who shades the mesh
        objects[0].data.materials[0] = bpy.data.materials.new(material)
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
        for obj in objects:
            evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
            key = f"{frame} {obj.name}"
            result[f"{key} positions"] = positions_of(evaluated).reshape(-1, 3)
            result[f"{key} corners"] = [v for face in evaluated.polygons for v in face.vertices]
            result[f"{key} problem"] = player.problem(obj)
            slots = [face.material_index for face in evaluated.polygons]
            result[f"{key} materials"] = [
                evaluated.materials[slot].name if slot < len(evaluated.materials) else ""
                for slot in slots
            ]
    result["text"] = description(objects[0])[1]
    return result


def describe_import(path, **options):
    scene = bpy.context.scene
    objects = import_file(path, **options)
    return {
        "names": [obj.name for obj in objects],
        "rotations": [obj.rotation_euler[:] for obj in objects],
        "scales": [obj.scale[:] for obj in objects],
        "starts": [obj.meshreel.start_frame for obj in objects],
        "range": [scene.frame_start, scene.frame_end],
        "frame": scene.frame_current,
        "rate": scene.render.fps / scene.render.fps_base,
        "normals": [vertex.normal[:] for vertex in objects[0].data.vertices],
    }


def import_surface(path):
    """Return polygons, layers and materials of each object; keys begin with its name."""
    results = {}
    for obj in import_file(path):
        mesh = obj.data
        values = {
            "positions": positions_of(mesh),
            "counts": [len(face.vertices) for face in mesh.polygons],
            "corners": [corner for face in mesh.polygons for corner in face.vertices],
            "materials": [slot.name for slot in obj.material_slots],
            "material_indices": [face.material_index for face in mesh.polygons],
        }
        for layer in mesh.uv_layers:
            values[f"uv {layer.name}"] = [item.vector[:] for item in layer.uv]
        for layer in mesh.color_attributes:
            name = f"{layer.data_type} {layer.domain} {layer.name}"
            is_bytes = layer.data_type == "BYTE_COLOR"
            values[name] = [(item.color_srgb if is_bytes else item.color)[:] for item in layer.data]
        results |= {f"{obj.name} {key}": value for key, value in values.items()}
    return results


def notes_of_import(path):
    """Import a mesh with faces that Blender drops."""
    (obj,) = import_file(path)
    return {"n_faces": len(obj.data.polygons), **shapes(obj, [0, 1])}


def import_error(path):
    try:
        import_file(path)
    except RuntimeError as error:
        return {"error": str(error), "n_objects": len(bpy.data.objects)}
    return {"error": "", "n_objects": len(bpy.data.objects)}


def lose_and_find(path, away):
    """Remove a file while it plays, and restore it."""
    (obj,) = import_file(path)
    before = shapes(obj, [1])["own"]
    os.rename(path, away)
    lost = shapes(obj, [2])["own"]
    is_error, text = description(obj)
    os.rename(away, path)
    result = shapes(obj, [2])["own"]
    return {
        "before": before, "lost": lost, "found": result, "is_error": is_error, "text": text,
        "problem_after": player.problem(obj),
    }  # fmt: skip


def change(path, other):
    """Replace a file while it plays."""
    (obj,) = import_file(path)
    before = shapes(obj, [1])["own"]
    os.replace(other, path)
    return {"before": before, **shapes(obj, [2]), "problem": player.problem(obj)}


def edit_mesh(path):
    (obj,) = import_file(path)
    obj.data.vertices.add(1)
    bpy.context.scene.frame_set(2)
    return {"problem": player.problem(obj)}


def save_scene(path, blend, frame):
    bpy.ops.wm.save_as_mainfile(filepath=blend)  # paths can be relative from now on
    (obj,) = import_file(path)
    bpy.context.scene.frame_set(frame)
    bpy.ops.wm.save_mainfile()
    return {"stored": obj.meshreel.filepath}


def open_scene(blend, frames):
    bpy.ops.wm.open_mainfile(filepath=blend)
    (obj,) = (one for one in bpy.data.objects if one.type == "MESH")
    return {"opened": positions_of(obj.data), "problem": player.problem(obj), **shapes(obj, frames)}


def render(path, folder):
    """Return the alpha of two rendered frames of a reel."""
    import_file(path, up="Z")
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 4.0
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0, 0, 5)
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 4
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.render.film_transparent = True
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(Path(folder) / "frame_")
    bpy.ops.render.render(animation=True)
    alphas = []
    for file in sorted(Path(folder).glob("frame_*.png")):
        image = bpy.data.images.load(str(file))
        alphas.append(np.array(image.pixels[:]).reshape(16, 16, 4)[..., 3])
    return {"alphas": np.array(alphas)}


# Exporting


def grid_object(name, size=2, n_cells=3):
    """Create a square of quads, n_cells on each side."""
    steps = np.linspace(-size / 2, size / 2, n_cells + 1)
    verts = [(x, y, 0.0) for y in steps for x in steps]
    row = n_cells + 1
    faces = [
        (y * row + x, y * row + x + 1, (y + 1) * row + x + 1, (y + 1) * row + x)
        for y in range(n_cells)
        for x in range(n_cells)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(verts, [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(obj)
    obj.select_set(True)
    return obj


def bulge(obj, last_frame):
    """Animate a shape key and a transform, starting at frame 1."""
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Bulge")
    for point in key.data:
        point.co.z = 1.0 + point.co.x * point.co.y
    for frame, value in ((1, 0.0), (last_frame, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
        obj.location = (value, 0.3, -value)
        obj.rotation_euler = (0.2, value, 0.0)
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_euler", frame=frame)


def world_shapes(obj, frames):
    """Return positions in the axes of a file with y up, of shape (T, V, 3)."""
    results = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
        matrix = evaluated.matrix_world
        points = np.array([matrix @ vertex.co for vertex in evaluated.data.vertices])
        results.append(points @ matrix_to_file("Y").T)
    return np.array(results)


def export(path, **options):
    try:
        bpy.ops.export_scene.meshreel(filepath=path, **options)
    except RuntimeError as error:
        return str(error)
    return ""


def export_shape_key(path, last_frame, **options):
    obj = grid_object("grid")
    bulge(obj, last_frame)
    obj.modifiers.new("Array", "ARRAY").count = 2
    bpy.context.scene.frame_set(3)
    error = export(path, frame_start=1, frame_end=last_frame, **options)
    frame_after = bpy.context.scene.frame_current
    return {
        "world": world_shapes(obj, range(1, last_frame + 1)),
        "error": error,
        "frame_after": frame_after,
    }


def decorate(obj, seed):
    """Add UV maps, colors and materials to an object."""
    rng = np.random.default_rng(seed)
    mesh = obj.data
    uv = mesh.uv_layers.new(name="map")
    uv.uv.foreach_set("vector", rng.random(2 * len(mesh.loops), np.float32))
    tint = mesh.color_attributes.new("tint", "FLOAT_COLOR", "POINT")
    tint.data.foreach_set("color", rng.random(4 * len(mesh.vertices), np.float32))
    paint = mesh.color_attributes.new("paint", "BYTE_COLOR", "CORNER")
    paint.data.foreach_set("color_srgb", rng.integers(0, 256, 4 * len(mesh.loops)) / 255)
    for name in ("skin", f"cloth {seed}"):
        mesh.materials.append(bpy.data.materials.get(name) or bpy.data.materials.new(name))
    mesh.polygons.foreach_set("material_index", np.arange(len(mesh.polygons)) % 2)


def export_parts(path):
    """Export two objects with surfaces; return them before and after import."""
    for number, name in enumerate(("body", "arm")):
        decorate(grid_object(name, n_cells=2 + number), number)
    error = export(path, frame_start=1, frame_end=2)
    before = {f"before {key}": value for key, value in _surfaces(("body", "arm")).items()}
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    import_file(path)
    after = {f"after {key}": value for key, value in _surfaces(("body", "arm")).items()}
    return {"error": error, **before, **after}


def _surfaces(names):
    results = {}
    for name in names:
        obj = bpy.data.objects[name]
        mesh = obj.data
        results[f"{name} corners"] = [corner for face in mesh.polygons for corner in face.vertices]
        results[f"{name} counts"] = [len(face.vertices) for face in mesh.polygons]
        results[f"{name} uv"] = [item.vector[:] for item in mesh.uv_layers["map"].uv]
        results[f"{name} tint"] = [item.color[:] for item in mesh.color_attributes["tint"].data]
        results[f"{name} paint"] = [
            item.color_srgb[:] for item in mesh.color_attributes["paint"].data
        ]
        results[f"{name} materials"] = [
            mesh.materials[face.material_index].name for face in mesh.polygons
        ]
    return results


def export_changing(path):
    """Export a mesh that loses faces at frame 4."""
    obj = grid_object("grid")
    bpy.context.scene.frame_set(2)
    build = obj.modifiers.new("Decimate", "DECIMATE")
    build.decimate_type = "UNSUBDIV"
    for frame, iterations in ((3, 0), (4, 2)):
        build.iterations = iterations
        build.keyframe_insert("iterations", frame=frame)
    error = export(path, frame_start=1, frame_end=6)
    return {"error": error, "frame_after": bpy.context.scene.frame_current}


def export_mirrored(path):
    """Return world position and UV of each corner of a mirrored object."""
    obj = grid_object("grid")
    decorate(obj, 0)
    obj.matrix_world = matrix = Matrix.Diagonal((-1, 1, 1, 1))
    error = export(path, frame_start=1, frame_end=1, up="Z", target="MAX_ERROR", max_error=1e-4)
    mesh, uv = obj.data, obj.data.uv_layers["map"].uv
    corners = [
        [
            (*(matrix @ mesh.vertices[mesh.loops[loop].vertex_index].co), *uv[loop].vector)
            for loop in face.loop_indices
        ]
        for face in mesh.polygons
    ]
    return {"error": error, "corners": corners}


def export_timed(path, fps, fps_base, start, end, step):
    grid_object("grid")
    set_rate(fps, fps_base)
    error = export(path, frame_start=start, frame_end=end, frame_step=step)
    (obj,) = import_file(path)
    return {"error": error, "start": obj.meshreel.start_frame}


class _Window:
    """Stub of the window manager and the workspace, which background mode lacks."""

    def __init__(self):
        self.progress, self.calls = [], []

    def progress_update(self, value):
        self.progress.append(value)

    def event_timer_add(self, step, window):
        return "timer"

    def __getattr__(self, name):
        return lambda *_: self.calls.append(name)


def export_from_window(path, stop_after):
    """Run the modal operator: one timer tick per step, Esc after some."""
    grid_object("grid")
    window = _Window()
    context = SimpleNamespace(
        scene=bpy.context.scene, selected_objects=bpy.context.selected_objects, window=None,
        evaluated_depsgraph_get=bpy.context.evaluated_depsgraph_get, window_manager=window,
        workspace=window,
    )  # fmt: skip
    methods = {name: value for name, value in vars(ExportReel).items() if callable(value)}
    settings = {
        "filepath": path, "target": "QUALITY", "quality": 80.0, "up": "Y", "frame_start": 1,
        "frame_end": 10, "frame_step": 1, "_timer": None, "_is_from_window": True,
    }  # fmt: skip
    operator = type("Operator", (), {**methods, **settings, "report": lambda *_: None})()
    status, n_ticks = operator.execute(context), 0
    while status == {"RUNNING_MODAL"}:
        event = SimpleNamespace(type="ESC" if n_ticks == stop_after else "TIMER")
        status, n_ticks = operator.modal(context, event), n_ticks + 1
    return {"status": list(status), "calls": window.calls, "progress": window.progress}


def stop_export(path, n_steps):
    """Cancel an export after some steps."""
    obj = grid_object("grid")
    bpy.context.scene.frame_set(7)
    choices = ExportChoices(range(1, 11), "Y", {"quality": 80})
    steps = export_reel(bpy.context, [obj], Path(path), choices, [])
    progress = [next(steps) for _ in range(n_steps)]
    steps.close()
    return {
        "progress": progress,
        "frame_after": bpy.context.scene.frame_current,
        "files": sorted(os.listdir(Path(path).parent)),
    }


def export_kinds(path):
    """Export a mesh without vertices, a beveled curve and a text."""
    for name in ("nothing", "tube", "words"):
        data = {
            "nothing": lambda: bpy.data.meshes.new("nothing"),
            "tube": lambda: bpy.data.curves.new("tube", "CURVE"),
            "words": lambda: bpy.data.curves.new("words", "FONT"),
        }[name]()
        obj = bpy.data.objects.new(name, data)
        bpy.context.collection.objects.link(obj)
        obj.select_set(True)
    bpy.data.curves["tube"].splines.new("POLY").points.add(3)
    for number, point in enumerate(bpy.data.curves["tube"].splines[0].points):
        point.co = (number, number % 2, 0, 1)
    bpy.data.curves["tube"].bevel_depth = 0.1
    bpy.data.curves["words"].body = "reel"
    error = export(path, frame_start=1, frame_end=2)
    imported = import_file(path)
    return {"error": error, "n_verts": [len(obj.data.vertices) for obj in imported]}


def export_without_frames(path, start, end):
    grid_object("grid")
    return {"error": export(path, frame_start=start, frame_end=end)}


def export_without_faces(path):
    mesh = bpy.data.meshes.new("points")
    mesh.vertices.add(3)
    obj = bpy.data.objects.new("points", mesh)
    bpy.context.collection.objects.link(obj)
    obj.select_set(True)
    return {"error": export(path, frame_start=1, frame_end=2)}


# Hard edges


def import_hard_edges(path, frames):
    """Return sharp edges of an imported mesh, and corner normals at frames."""
    (obj,) = import_file(path)
    normals = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        normals.append([normal.vector[:] for normal in obj.data.corner_normals])
    edges = [sorted(edge.vertices) for edge in obj.data.edges if edge.use_edge_sharp]
    return {"edges": np.array(edges), "normals": np.array(normals)}


def export_hard_edges(path, kind):
    """Create a cube: flat, smooth, with sharp edges around its top, or custom normals there."""
    bpy.ops.mesh.primitive_cube_add()
    obj = bpy.context.object
    mesh = obj.data
    mesh.polygons.foreach_set("use_smooth", [kind != "flat"] * len(mesh.polygons))
    top = {vertex.index for vertex in mesh.vertices if vertex.co.z > 0}
    if kind == "sharp":
        for edge in mesh.edges:
            edge.use_edge_sharp = {*edge.vertices} <= top
    if kind == "custom":
        normals = []
        for face in mesh.polygons:
            is_top = face.normal.z > 0.5
            for vertex in face.vertices:
                across = mesh.vertices[vertex].co.normalized()
                normals.append((0, 0, 1) if is_top else across)
        mesh.normals_split_custom_set(normals)
    mesh.update()
    return {"error": export(path, frame_start=1, frame_end=1)}
