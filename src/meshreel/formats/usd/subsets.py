"""Subsets of the faces of a mesh as groups, materials first."""

from typing import Any

import numpy as np

from meshreel.formats.extras import USD
from meshreel.formats.usd.material_reading import MeshMaterials, label_of
from meshreel.model.surface import FaceGroups, Int32s

MATERIALS = "materialBind"
"""The family of subsets that materials are bound to."""

UNNAMED = "group"
"""The name under which subsets of no family are taken together."""


def read_groups(
    prim: Any, code: float, n_faces: int, materials: MeshMaterials, notes: list[str]
) -> tuple[FaceGroups, ...]:
    """Groups of the faces of a mesh at a time code.

    Materials are those of subsets, and elsewhere that of the whole mesh. A label is the name that
    people are shown if there is one, else that of the prim.

    Parameters
    ----------
    prim : Usd.Prim
    materials : MeshMaterials
        Those of the mesh; gives their labels.
    notes : list of str
        Gains a sentence for each family whose subsets overlap or name faces that are not there.
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
        members = families.setdefault(family, [])
        members.append((label, np.asarray([] if faces is None else faces, np.int32)))
    groups = []
    for family, members in families.items():
        name, rest = (
            ("material", materials.bound_label(prim)) if family == MATERIALS else (family, "")
        )
        group, is_clean = _group(name, members, rest, n_faces)
        if not is_clean:
            notes.append(
                f"{name} subsets of {prim.GetPath()} overlap or name faces that are not there; "
                "a face is in the last one that names it"
            )
        groups.append(group)
    return tuple(group for group in groups if group.labels)


def _group(
    name: str, members: list[tuple[str, Int32s]], rest: str, n_faces: int
) -> tuple[FaceGroups, bool]:
    """Faces by their label, all others with the label `rest`; and whether each was named once."""
    labels: dict[str, int] = {}
    numbers = np.full(n_faces, -1, np.int32)
    n_named = 0
    for label, faces in members:
        inside = faces[(faces >= 0) & (faces < n_faces)]
        numbers[inside] = labels.setdefault(label, len(labels))
        n_named += len(faces)
    is_clean = n_named == np.count_nonzero(numbers >= 0)
    if rest and (numbers < 0).any():
        numbers[numbers < 0] = labels.setdefault(rest, len(labels))
    return FaceGroups(name, tuple(labels), numbers), is_clean
