"""File > Export > Meshreel."""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ExportHelper

from meshreel.errors import MeshReelError
from meshreel.model.notes import Notes

from .axes import UP_ITEMS, Up
from .exporter import ExportChoices, export_reel
from .scene_reading import ExportError

SURFACES = frozenset({"MESH", "CURVE", "SURFACE", "FONT", "META"})
"""Object types with a surface."""

TICK_S = 0.01
TARGET_ITEMS = (
    ("QUALITY", "Quality", "As good as can be seen, for models of any size"),
    ("MAX_ERROR", "Maximum Error", "No vertex of any frame is off by more than this bound"),
)


class ExportReel(bpy.types.Operator, ExportHelper):
    """Operator that exports the selected objects; Esc cancels it in a window."""

    bl_idname = "export_scene.meshreel"
    bl_label = "Export Meshreel"
    bl_description = "Export the selected objects, as they move, as a compressed mesh animation"
    bl_options = {"PRESET"}  # noqa: RUF012

    filename_ext = ".reel"
    filter_glob: bpy.props.StringProperty(default="*.reel", options={"HIDDEN"})
    target: bpy.props.EnumProperty(name="Target", items=TARGET_ITEMS, default="QUALITY")
    quality: bpy.props.FloatProperty(
        name="Quality",
        description="1 to 100; every 12 points halve the error",
        default=80.0,
        min=1.0,
        max=100.0,
    )
    max_error: bpy.props.FloatProperty(
        name="Maximum Error",
        description="In percent of the diagonal of the bounding box of all frames",
        default=0.1,
        min=1e-4,
        soft_max=10.0,
        precision=4,
    )
    frame_start: bpy.props.IntProperty(name="First Frame", default=1)
    frame_end: bpy.props.IntProperty(name="Last Frame", default=250)
    frame_step: bpy.props.IntProperty(name="Step", default=1, min=1)
    up: bpy.props.EnumProperty(
        name="Up Axis",
        description="Up axis of the file",
        items=UP_ITEMS,
        default=Up.Y.value,
    )

    _is_from_window = False
    _work: Generator[float, None, None]
    _notes: Notes
    _timer: Any = None

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether an object that can be exported is selected."""
        cls.poll_message_set("Select an object that has a surface, in Object Mode")
        return context.mode == "OBJECT" and bool(_exportable(context))

    def invoke(self, context: Any, event: Any) -> Any:
        """Open the file browser, with the frame range of the scene as default."""
        self._is_from_window = True
        scene = context.scene
        self.frame_start, self.frame_end = scene.frame_start, scene.frame_end
        self.frame_step = scene.frame_step
        return super().invoke(context, event)

    def draw(self, context: Any) -> None:
        """Draw the options in the file browser."""
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "target")
        layout.prop(self, "quality" if self.target == "QUALITY" else "max_error")
        for name in ("frame_start", "frame_end", "frame_step", "up"):
            layout.prop(self, name)

    def execute(self, context: Any) -> set[str]:
        """Export: in steps between window events, or at once without a window."""
        if self.frame_end < self.frame_start:
            self.report(
                {"ERROR"}, f"no frames in {self.frame_start} to {self.frame_end}; swap them"
            )
            return {"CANCELLED"}
        self._notes = Notes()
        self._work = export_reel(
            context, _exportable(context), Path(bpy.path.abspath(self.filepath)), self._choices(),
            self._notes,
        )  # fmt: skip
        context.window_manager.progress_begin(0, 100)
        if self._is_from_window:
            return self._begin_modal(context)
        while (status := self._go_on(context)) == {"RUNNING_MODAL"}:
            pass
        return status

    def modal(self, context: Any, event: Any) -> set[str]:
        """Run one step at each timer event; block other events."""
        if event.type == "ESC":
            self.report({"INFO"}, "the export was canceled; no file was written")
            return self._end(context, {"CANCELLED"})
        return self._go_on(context) if event.type == "TIMER" else {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Cancel the export when Blender closes."""
        if self._timer:
            self._end(context, {"CANCELLED"})

    def _choices(self) -> ExportChoices:
        name = "quality" if self.target == "QUALITY" else "max_error"
        frames = range(self.frame_start, self.frame_end + 1, self.frame_step)
        return ExportChoices(frames, self.up, {name: getattr(self, name)})

    def _begin_modal(self, context: Any) -> set[str]:
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK_S, window=context.window)
        manager.modal_handler_add(self)
        context.workspace.status_text_set("Exporting; Esc stops it")
        return {"RUNNING_MODAL"}

    def _go_on(self, context: Any) -> set[str]:
        try:
            context.window_manager.progress_update(100 * next(self._work))
        except StopIteration:
            for note in self._notes:
                self.report({"WARNING"}, note)
            return self._end(context, {"FINISHED"})
        except (ExportError, MeshReelError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return self._end(context, {"CANCELLED"})
        return {"RUNNING_MODAL"}

    def _end(self, context: Any, status: set[str]) -> set[str]:
        self._work.close()
        context.window_manager.progress_end()
        if self._timer:
            context.window_manager.event_timer_remove(self._timer)
            context.workspace.status_text_set(None)
            self._timer = None
        return status


def _exportable(context: Any) -> list[Any]:
    """Selected objects with a surface, by name."""
    objects = (obj for obj in context.selected_objects if obj.type in SURFACES)
    return sorted(objects, key=lambda obj: obj.name)


def _draw_menu(menu: Any, context: Any) -> None:
    menu.layout.operator(ExportReel.bl_idname, text="Meshreel (.reel)")


def register() -> None:
    """Register the operator and its menu entry."""
    bpy.utils.register_class(ExportReel)
    bpy.types.TOPBAR_MT_file_export.append(_draw_menu)


def unregister() -> None:
    """Unregister them."""
    bpy.types.TOPBAR_MT_file_export.remove(_draw_menu)
    bpy.utils.unregister_class(ExportReel)
