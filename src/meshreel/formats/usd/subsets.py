"""Reading face subsets of a mesh as groups, materials first."""

from typing import Any

import numpy as np

from meshreel.formats.usd.material_reading import MeshMaterials, label_of
from meshreel.model.surface import FaceGroups, Int32s
from meshreel.runtime.extras import USD

MATERIALS = "materialBind"
"""The subset family for material bindings."""

UNNAMED = "group"
"""Name of the group of subsets without a family."""


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
