"""File > Import > Meshreel."""

from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ImportHelper

from meshreel.errors import MeshReelError

from .axes import UP_ITEMS, Up
from .importer import import_reel
from .open_reels import UnplayableError


class ImportReel(bpy.types.Operator, ImportHelper):
    """Operator that imports a file."""

    bl_idname = "import_scene.meshreel"
    bl_label = "Import Meshreel"
    bl_description = "Import a compressed mesh animation that follows the timeline"
    bl_options = {"REGISTER", "UNDO", "PRESET"}  # noqa: RUF012

    filename_ext = ".reel"
    # Not remembered: the next call would mistake it for a dropped file.
    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"HIDDEN", "SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.reel", options={"HIDDEN"})
    up: bpy.props.EnumProperty(
        name="Up Axis", description="Up axis of the file", items=UP_ITEMS,
        default=Up.Y.value,
    )  # fmt: skip
    scale: bpy.props.FloatProperty(
        name="Scale", description="Scale of the objects", default=1.0, min=1e-6, soft_max=1000.0
    )
    set_range: bpy.props.BoolProperty(
        name="Set Frame Range",
        description="Set the frame range of the scene to that of the file",
        default=True,
    )
    set_rate: bpy.props.BoolProperty(
        name="Set Frame Rate",
        description="Set the frame rate of the scene to that of the file. Otherwise the file keeps "
        "its speed, and frames are interpolated",
        default=False,
    )
    relative_path: bpy.props.BoolProperty(
        name="Relative Path",
        description="Store the path relative to the .blend file, once that is saved",
        default=True,
    )

    def execute(self, context: Any) -> set[str]:
        """Import the selected file."""
        path = Path(bpy.path.abspath(self.filepath))
        try:
            imported = import_reel(
                path, context.scene, context.collection, stored_path=self._stored(path),
                up=self.up, scale=self.scale, set_rate=self.set_rate, set_range=self.set_range,
            )  # fmt: skip
        except (UnplayableError, MeshReelError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for note in imported.notes:
            self.report({"WARNING"}, note)
        _select_only(context, imported.objects)
        return {"FINISHED"}

    def invoke(self, context: Any, event: Any) -> Any:
        """Open the file browser, or, for a dropped file, a dialog with the options."""
        if not self.filepath:
            return super().invoke(context, event)
        return context.window_manager.invoke_props_dialog(
            self, title=Path(self.filepath).name, confirm_text="Import"
        )

    def _stored(self, path: Path) -> str:
        if not (self.relative_path and bpy.data.is_saved):
            return str(path)
        try:
            return bpy.path.relpath(str(path))  # type: ignore[no-any-return]
        except ValueError:  # another drive on Windows
            return str(path)


class ReelFileHandler(bpy.types.FileHandler):
    """Handler of `.reel` files that are dropped on a viewport."""

    bl_idname = "IO_FH_meshreel"
    bl_label = "Meshreel"
    bl_import_operator = ImportReel.bl_idname
    bl_file_extensions = ".reel"

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        """Whether a file can be dropped here."""
        return bool(context.area and context.area.type == "VIEW_3D")


def _select_only(context: Any, objects: list[Any]) -> None:
    for obj in context.selected_objects:
        obj.select_set(False)
    for obj in objects:
        obj.select_set(True)
        context.view_layer.objects.active = obj


def _draw_menu(menu: Any, context: Any) -> None:
    menu.layout.operator(ImportReel.bl_idname, text="Meshreel (.reel)")


def register() -> None:
    """Register the operator and its menu entry."""
    bpy.utils.register_class(ImportReel)
    bpy.utils.register_class(ReelFileHandler)
    bpy.types.TOPBAR_MT_file_import.append(_draw_menu)


def unregister() -> None:
    """Unregister them."""
    bpy.types.TOPBAR_MT_file_import.remove(_draw_menu)
    bpy.utils.unregister_class(ReelFileHandler)
    bpy.utils.unregister_class(ImportReel)
