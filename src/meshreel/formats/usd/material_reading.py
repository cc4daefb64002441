"""Reading materials of meshes of a stage: appearance and images, and face subsets as groups."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.formats.notes import MaterialNotes
from meshreel.formats.usd.preview_surface import PreviewSurface
from meshreel.formats.usd.stage_images import StageImages
from meshreel.model.materials import Image, Material, select_materials
from meshreel.model.surface import FaceGroups, Int32s
from meshreel.runtime.extras import USD

MATERIALS = "materialBind"
"""The subset family for material bindings."""

UNNAMED = "group"
"""Name of the group of subsets without a family."""


class StageMaterials:
    """The materials of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Folder of the stage's file, which must contain the images; None allows any location.
    notes : list of str
        Gains a sentence for each kind of material property that is not read.
    """

    def __init__(self, folder: Path | None, notes: list[str]) -> None:
        self._stage_images = StageImages(folder)
        self._notes = MaterialNotes(notes)
        self._looks: dict[str, Material | None] = {}

    @property
    def images(self) -> list[Image]:
        """The images read so far, to which materials refer."""
        return self._stage_images.images

    def look(self, material: Any) -> Material | None:
        """Return the appearance of a ``UsdShade.Material``, unnamed, or None if not readable.

        Materials of instances share one result.
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
                self._notes.add("appearance of materials without UsdPreviewSurface", name)
            return None
        if shader.GetShaderId() != "UsdPreviewSurface":
            self._notes.add("appearance of materials other than UsdPreviewSurface", name)
            return None
        if any(material.GetOutput(one).HasConnectedSource() for one in ("displacement", "volume")
               if material.GetOutput(one)):  # fmt: skip
            self._notes.add("displacement and volumes of materials", name)
        return PreviewSurface(shader, name, self._stage_images, self._notes).material()


class MeshMaterials:
    """The materials of a mesh, by face label.

    Parameters
    ----------
    prim : Usd.Prim
        Prim of the mesh.
    materials : StageMaterials
        Materials of the stage.
    """

    def __init__(self, prim: Any, materials: StageMaterials) -> None:
        mesh = USD.load("UsdGeom").Gprim(prim)
        self._is_double_sided = bool(mesh.GetDoubleSidedAttr().Get())
        self._materials = materials
        self._looks: dict[str, Material | None] = {}

    def bound_label(self, prim: Any) -> str:
        """Return the label of the material bound to a prim; empty if there is none.

        Materials with the same name but different appearance get different labels.
        """
        material, _ = USD.load("UsdShade").MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return ""
        look = self._materials.look(material)
        candidates = (
            label
            for label in _numbered(label_of(material.GetPrim()))
            if self._looks.setdefault(label, look) == look
        )
        return next(candidates)

    def look(self) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Return the materials of all labels so far, and the images that they use."""
        materials = [
            replace(look, name=label, double_sided=self._is_double_sided)
            for label, look in self._looks.items()
            if look is not None
        ]
        return select_materials([one.name for one in materials], materials, self._materials.images)


def label_of(prim: Any) -> str:
    """Return the display name of a prim, or else its name."""
    return str(prim.GetDisplayName() or prim.GetName())


def _numbered(name: str) -> Iterator[str]:
    """Yield the name, then the name with suffixes _2, _3 and so on."""
    yield name
    yield from (f"{name}_{number}" for number in count(2))


def read_groups(
    prim: Any, code: float, n_faces: int, materials: MeshMaterials, notes: list[str]
) -> tuple[FaceGroups, ...]:
    """Return the face groups of a mesh at a time code.

    Materials are those of subsets or, elsewhere, of the whole mesh. A label is the display name of
    the prim if it has one, otherwise its name.

    Parameters
    ----------
    prim : Usd.Prim
    materials : MeshMaterials
        Materials of the mesh, which provide labels.
    notes : list of str
        Gains a sentence for each family whose subsets overlap or refer to missing faces.
    """
    geometry = USD.load("UsdGeom")
    families: dict[str, list[tuple[str, Int32s]]] = {MATERIALS: []}
    for subset in geometry.Subset.GetAllGeomSubsets(geometry.Imageable(prim)):
        if subset.GetElementTypeAttr().Get() != geometry.Tokens.face:
            continue
        family = str(subset.GetFamilyNameAttr().Get() or UNNAMED)
        material = materials.bound_label(subset.GetPrim()) if family == MATERIALS else ""
        label = material or label_of(subset.GetPrim())
        faces = subset.GetIndicesAttr().Get(code)
        if not faces and subset.GetIndicesAttr().ValueMightBeTimeVarying():
            continue  # a label of other times
        members = families.setdefault(family, [])
        members.append((label, np.asarray([] if faces is None else faces, np.int32)))
    groups = []
    for family, members in families.items():
        name, default = (
            ("material", materials.bound_label(prim)) if family == MATERIALS else (family, "")
        )
        group, is_partition = _group(name, members, default, n_faces)
        if not is_partition:
            notes.append(
                f"{name} subsets of {prim.GetPath()} overlap or refer to missing faces; "
                "a face belongs to the last subset that contains it"
            )
        groups.append(group)
    return tuple(group for group in groups if group.labels)


def _group(
    name: str, members: list[tuple[str, Int32s]], default: str, n_faces: int
) -> tuple[FaceGroups, bool]:
    """Return a group, with `default` as label of the other faces, and whether subsets are disjoint
    and valid.
    """
    labels: dict[str, int] = {}
    numbers = np.full(n_faces, -1, np.int32)
    n_listed = 0
    for label, faces in members:
        inside = faces[(faces >= 0) & (faces < n_faces)]
        numbers[inside] = labels.setdefault(label, len(labels))
        n_listed += len(faces)
    is_partition = n_listed == np.count_nonzero(numbers >= 0)
    if default and (numbers < 0).any():
        numbers[numbers < 0] = labels.setdefault(default, len(labels))
    return FaceGroups(name, tuple(labels), numbers), is_partition
