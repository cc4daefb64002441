"""Run in a Python with Blender: import or export an Alembic file, and print its contents.

python alembic_in_blender.py bring|send FILE.abc RESULT.npz
"""

import math
import sys

import bpy
import numpy as np

FPS, FIRST, LAST = 30, 5, 14


def empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = FPS, FIRST, LAST
    return scene


def bring(path):
    scene = empty_scene()
    bpy.ops.wm.alembic_import(filepath=path, as_background_job=False)
    [results] = [one for one in bpy.data.objects if one.type == "MESH"]
    return {
        "range": (scene.frame_start, scene.frame_end),
        **described(results, scene, (FIRST, FIRST + 3, FIRST + 5)),
    }


def send(path):
    scene = empty_scene()
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    animate(monkey, scene)
    decorate(monkey.data)
    bpy.ops.wm.alembic_export(
        filepath=path, start=FIRST, end=LAST, face_sets=True, as_background_job=False
    )
    return described(monkey, scene, range(FIRST, LAST + 1))


def animate(monkey, scene):
    """Create an animated shape with an animated parent."""
    monkey.shape_key_add(name="Basis")
    key = monkey.shape_key_add(name="wave")
    for number, point in enumerate(key.data):
        point.co.x += 0.3 * math.sin(number)
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    monkey.parent, monkey.scale = parent, (1, 2, -0.5)
    for frame, share in ((FIRST, 0), (LAST, 1)):
        key.value = share
        key.keyframe_insert("value", frame=frame)
        parent.location, parent.rotation_euler = (
            (3 * share, share, 2 * share),
            (share, 0, 2 * share),
        )
        parent.keyframe_insert("location", frame=frame)
        parent.keyframe_insert("rotation_euler", frame=frame)


def decorate(mesh):
    for name in ("red", "blue"):
        mesh.materials.append(bpy.data.materials.new(name))
    for polygon in mesh.polygons:
        polygon.material_index = polygon.index % 2
    second = mesh.uv_layers.new(name="second")
    numbers = np.random.default_rng(0).random(2 * len(second.data)).astype(np.float32)
    second.data.foreach_set("uv", numbers)


def described(found, scene, frames):
    """Return world positions, polygons, materials and texture coordinates of an object."""
    result = {}
    for frame in frames:
        scene.frame_set(frame)
        moved = found.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = moved.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        world = np.array(moved.matrix_world)
        result[f"frame_{frame}"] = points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    result["sizes"] = [len(polygon.vertices) for polygon in mesh.polygons]
    result["corners"] = [corner for polygon in mesh.polygons for corner in polygon.vertices]
    materials = [slot.material.name for slot in found.material_slots]
    result["materials"] = [materials[polygon.material_index] for polygon in mesh.polygons]
    for layer in mesh.uv_layers:
        numbers = np.empty(2 * len(layer.data), np.float32)
        layer.data.foreach_get("uv", numbers)
        result[f"uv_{layer.name}"] = numbers.reshape(-1, 2)
    return result


if __name__ == "__main__":
    action, path, result = sys.argv[1:]
    np.savez(result, **{"bring": bring, "send": send}[action](path))
