"""Materials of a stage that is being written: UsdPreviewSurface with its textures."""

from typing import Any

from meshreel.formats.extras import USD
from meshreel.formats.notes import LookNotes
from meshreel.formats.usd.prim_names import different, prim_name
from meshreel.formats.usd.texture_writing import TextureWriter
from meshreel.model.materials import AlphaMode, Material
from meshreel.model.surface import FaceGroups


class Materials:
    """The materials of a stage, each made when it is first bound.

    Parameters
    ----------
    stage : Usd.Stage
    root : str
        The path that they go under.
    taken : set of str
        Names of prims that are there already.
    looks : tuple of Material
        How those look of which more than a name is known.
    notes : list of str
        Gains a sentence for each kind of thing that USD does not have.
    """

    def __init__(
        self,
        stage: Any,
        root: str,
        taken: set[str],
        looks: tuple[Material, ...],
        textures: TextureWriter,
        notes: list[str],
    ) -> None:
        self._stage = stage
        self._scope = f"{root}/{different('Materials', taken)}"
        self._names: set[str] = set()
        self._made: dict[str, Any] = {}
        self._looks = {one.name: one for one in looks}
        self._textures, self._notes = textures, LookNotes(notes)

    def bind(self, prim: Any, label: str) -> None:
        """Bind the material of that label to a prim."""
        shading = USD.load("UsdShade")
        if not self._made:
            USD.load("UsdGeom").Scope.Define(self._stage, self._scope)
        if label not in self._made:
            name = different(prim_name(label), self._names)
            self._made[label] = shading.Material.Define(self._stage, f"{self._scope}/{name}")
            show_as(self._made[label].GetPrim(), label)
            if label in self._looks:
                self._write(self._made[label], self._looks[label])
        shading.MaterialBindingAPI.Apply(prim).Bind(self._made[label])

    def show_both_sides(self, prim: Any, groups: FaceGroups) -> None:
        """Tell the prim of a mesh that it has two sides if one of its materials has."""
        looks = [self._looks[one] for one in groups.labels if one in self._looks]
        if not looks:
            return
        is_double = any(one.double_sided for one in looks)
        USD.load("UsdGeom").Gprim(prim).CreateDoubleSidedAttr(is_double)
        if is_double and not all(one.double_sided for one in looks):
            single = [one.name for one in looks if not one.double_sided]
            for name in single:
                self._notes.add(
                    "that materials have one side only, for others of the mesh have two", name
                )

    def note_unused(self) -> None:
        """Add to the notes which materials no face has."""
        for name in self._looks:
            if name not in self._made:
                self._notes.add("materials that no face has", name)

    def _write(self, material: Any, look: Material) -> None:
        shading, types = USD.load("UsdShade"), USD.load("Sdf").ValueTypeNames
        shader = shading.Shader.Define(self._stage, f"{material.GetPath()}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        made = self._textures.of(material, look, self._notes)
        inputs = (
            ("base_color", "diffuseColor", types.Color3f, look.base_color[:3]),
            ("metallic", "metallic", types.Float, look.metallic),
            ("roughness", "roughness", types.Float, look.roughness),
            ("emissive", "emissiveColor", types.Color3f, look.emissive),
            ("normal", "normal", types.Normal3f, None),
            ("occlusion", "occlusion", types.Float, None),
        )
        for slot, name, kind, value in inputs:
            if slot in made:
                shader.CreateInput(name, kind).ConnectToSource(made[slot])
            elif value is not None:
                shader.CreateInput(name, kind).Set(value)
        self._write_opacity(shader, look, made.get("alpha"))
        if look.unlit:
            self._notes.add("that materials are unlit, for USD does not have it", look.name)

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


def show_as(prim: Any, label: str) -> None:
    """Give a prim the name that people are shown, if it is another."""
    if prim.GetName() != label:
        prim.SetDisplayName(label)
