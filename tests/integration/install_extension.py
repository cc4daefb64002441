"""Validate and install the extension in Blender: `... ZIP OUT.reel`."""

import os
import subprocess
import sys
from pathlib import Path

import bpy

NAME = "bl_ext.user_default.meshreel"


def main(archive, reel):
    import addon_utils  # bpy adds it to the path

    tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core/bl_pkg/cli/blender_ext.py"
    subprocess.run([sys.executable, tool, "validate", archive], check=True)
    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True
    )
    assert NAME in bpy.context.preferences.addons
    packages = Path(bpy.utils.user_resource("EXTENSIONS")).rglob("site-packages/*")
    installed = {package.name.partition(".")[0] for package in packages}
    assert {"meshreel", "threadpoolctl"} <= installed, installed

    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.export_scene.meshreel(filepath=reel, frame_start=1, frame_end=3)
    bpy.ops.import_scene.meshreel(filepath=reel)
    assert [len(obj.data.polygons) for obj in bpy.context.selected_objects] == [6]

    addon_utils.disable(NAME)
    assert not hasattr(bpy.types.Object, "meshreel")
    assert not [
        handler for handler in bpy.app.handlers.frame_change_pre if "meshreel" in handler.__module__
    ]
    print("validated, installed, exported, imported, disabled")


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # the bpy module may crash when the interpreter exits
