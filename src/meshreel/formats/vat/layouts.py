"""The layouts of vertex animation textures, by their ``--layout`` name."""

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
"""Layouts with one texel per vertex and frame."""

PCA = "pca"
"""The layout of `meshreel.formats.vat.pca`."""

LAYOUT_NAMES = (*LAYOUTS, PCA)
