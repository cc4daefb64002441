"""The layouts of vertex animation textures, by the names that `--layout` takes."""

from meshreel.formats.vat.axes import BLENDER_FBX_SPACE, GLTF, UNITY, UNREAL
from meshreel.formats.vat.labs import LabsSoft
from meshreel.formats.vat.openvat import OpenVat
from meshreel.formats.vat.plain_layout import PlainLayout

DEFAULT_LAYOUT = "openvat"

LAYOUTS: dict[str, PlainLayout] = {
    "openvat": OpenVat(),
    "openvat-unity": OpenVat(BLENDER_FBX_SPACE),
    "labs": LabsSoft(GLTF),
    "labs-unity": LabsSoft(UNITY),
    "labs-unreal": LabsSoft(UNREAL),
}
"""Layouts of a texel for each vertex in each frame."""

PCA = "pca"
"""That of `meshreel.formats.vat.pca`."""

LAYOUT_NAMES = (*LAYOUTS, PCA)
