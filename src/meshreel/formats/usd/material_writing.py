"""Writing materials of a stage: UsdPreviewSurface with its textures."""

from typing import Any

from meshreel.formats.notes import MaterialNotes
from meshreel.formats.usd.prim_names import prim_name, unique_name
from meshreel.formats.usd.texture_writing import TextureWriter
from meshreel.model.materials import AlphaMode, Material
from meshreel.model.surface import FaceGroups
from meshreel.runtime.extras import USD


class Materials:
    """The materials of a stage, each created when it is first bound.

    Parameters
    ----------
    stage : Usd.Stage
    root : str
        Path of the prim above the materials.
    used : set of str
        Names of existing prims below the root.
    looks : tuple of Material
        Known appearance of materials, by their names.
    notes : list of str
        Gains a sentence for each kind of property that USD cannot store.
    """

    def __init__(
        self,
        stage: Any,
        root: str,
        used: set[str],
        looks: tuple[Material, ...],
        textures: TextureWriter,
        notes: list[str],
    ) -> None:
        self._stage = stage
        self._scope = f"{root}/{unique_name('Materials', used)}"
        self._names: set[str] = set()
        self._created: dict[str, Any] = {}
        self._looks = {one.name: one for one in looks}
        self._textures, self._notes = textures, MaterialNotes(notes)

    def bind(self, prim: Any, label: str) -> None:
        """Bind the material of a label to a prim."""
        shading = USD.load("UsdShade")
        if not self._created:
            USD.load("UsdGeom").Scope.Define(self._stage, self._scope)
        if label not in self._created:
            name = unique_name(prim_name(label), self._names)
            self._created[label] = shading.Material.Define(self._stage, f"{self._scope}/{name}")
            set_display_name(self._created[label].GetPrim(), label)
            if label in self._looks:
                self._write(self._created[label], self._looks[label])
        shading.MaterialBindingAPI.Apply(prim).Bind(self._created[label])

    def write_double_sided(self, prim: Any, groups: FaceGroups) -> None:
        """Declare a mesh double-sided if any of its materials is."""
        looks = [self._looks[one] for one in groups.labels if one in self._looks]
        if not looks:
            return
        is_double = any(one.double_sided for one in looks)
        USD.load("UsdGeom").Gprim(prim).CreateDoubleSidedAttr(is_double)
        if is_double and not all(one.double_sided for one in looks):
            single = [one.name for one in looks if not one.double_sided]
            for name in single:
                self._notes.add(
                    "single-sidedness of materials on meshes with double-sided ones", name
                )

    def note_unused(self) -> None:
        """Note the materials that no face uses."""
        for name in self._looks:
            if name not in self._created:
                self._notes.add("materials that no face uses", name)

    def _write(self, material: Any, look: Material) -> None:
        shading, types = USD.load("UsdShade"), USD.load("Sdf").ValueTypeNames
        shader = shading.Shader.Define(self._stage, f"{material.GetPath()}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        outputs = self._textures.write(material, look, self._notes)
        inputs = (
            ("base_color", "diffuseColor", types.Color3f, look.base_color[:3]),
            ("metallic", "metallic", types.Float, look.metallic),
            ("roughness", "roughness", types.Float, look.roughness),
            ("emissive", "emissiveColor", types.Color3f, look.emissive),
            ("normal", "normal", types.Normal3f, None),
            ("occlusion", "occlusion", types.Float, None),
        )
        for slot, name, kind, value in inputs:
            if slot in outputs:
                shader.CreateInput(name, kind).ConnectToSource(outputs[slot])
            elif value is not None:
                shader.CreateInput(name, kind).Set(value)
        self._write_opacity(shader, look, outputs.get("alpha"))
        if look.unlit:
            self._notes.add("unlit shading of materials, which USD cannot store", look.name)

    def _write_opacity(self, shader: Any, look: Material, alpha: Any) -> None:
        types = USD.load("Sdf").ValueTypeNames
        if look.alpha_mode is AlphaMode.OPAQUE:
            return
        opacity = shader.CreateInput("opacity", types.Float)
        if alpha is None:
            opacity.Set(look.base_color[3])
        else:
            opacity.ConnectToSource(alpha)
        if look.alpha_mode is AlphaMode.MASK:
            shader.CreateInput("opacityThreshold", types.Float).Set(look.alpha_cutoff)


def set_display_name(prim: Any, label: str) -> None:
    """Set the display name of a prim, if it differs from its name."""
    if prim.GetName() != label:
        prim.SetDisplayName(label)
