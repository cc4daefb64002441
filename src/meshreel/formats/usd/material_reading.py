"""Materials that are bound to meshes of a stage: their labels, how they look, their images."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

from meshreel.formats.extras import USD
from meshreel.formats.notes import LookNotes
from meshreel.formats.usd.preview_surface import PreviewSurface
from meshreel.formats.usd.stage_images import StageImages
from meshreel.model.materials import Image, Material, used_by


class StageMaterials:
    """The materials of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Where images must be, or below: that of the stage's file. None: anywhere.
    notes : list of str
        Gains a sentence for each kind of thing that is not kept.
    """

    def __init__(self, folder: Path | None, notes: list[str]) -> None:
        self._stage_images = StageImages(folder)
        self._notes = LookNotes(notes)
        self._looks: dict[str, Material | None] = {}

    @property
    def images(self) -> list[Image]:
        """Those read so far, which looks refer to."""
        return self._stage_images.images

    def look(self, material: Any) -> Material | None:
        """How a ``UsdShade.Material`` looks, without a name; None if that is not said or not read.

        It is the same for materials of instances.
        """
        path = str(material.GetPath())
        if path not in self._looks:
            self._looks[path] = self._read(material)
        return self._looks[path]

    def _read(self, material: Any) -> Material | None:
        name = label_of(material.GetPrim())
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader:
            if any(output.HasConnectedSource() for output in material.GetOutputs()):
                self._notes.add("how materials look that have no UsdPreviewSurface", name)
            return None
        if shader.GetShaderId() != "UsdPreviewSurface":
            self._notes.add("how materials look that are no UsdPreviewSurface", name)
            return None
        if any(material.GetOutput(one).HasConnectedSource() for one in ("displacement", "volume")
               if material.GetOutput(one)):  # fmt: skip
            self._notes.add("displacement and volumes of materials", name)
        return PreviewSurface(shader, name, self._stage_images, self._notes).material()


class MeshMaterials:
    """The materials of a mesh, by labels of its faces.

    Parameters
    ----------
    prim : Usd.Prim
        The mesh.
    """

    def __init__(self, prim: Any, materials: StageMaterials) -> None:
        mesh = USD.load("UsdGeom").Gprim(prim)
        self._is_double_sided = bool(mesh.GetDoubleSidedAttr().Get())
        self._materials = materials
        self._looks: dict[str, Material | None] = {}

    def bound_label(self, prim: Any) -> str:
        """The label of the material that is bound to a prim; empty if there is none.

        Two of one name that look different have different labels.
        """
        material, _ = USD.load("UsdShade").MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return ""
        look = self._materials.look(material)
        free = (
            label
            for label in _numbered(label_of(material.GetPrim()))
            if self._looks.setdefault(label, look) == look
        )
        return next(free)

    def look(self) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """The materials of all labels so far, and the images that they show."""
        found = [
            replace(look, name=label, double_sided=self._is_double_sided)
            for label, look in self._looks.items()
            if look is not None
        ]
        return used_by([one.name for one in found], found, self._materials.images)


def label_of(prim: Any) -> str:
    """The name of a prim: that for people if it has one."""
    return str(prim.GetDisplayName() or prim.GetName())


def _numbered(name: str) -> Iterator[str]:
    """The name, then the name with 2, 3, ... behind it."""
    yield name
    yield from (f"{name}_{number}" for number in count(2))
