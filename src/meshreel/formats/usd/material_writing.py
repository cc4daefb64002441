"""Writing materials of a stage: UsdPreviewSurface with its textures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from meshreel.formats.notes import MaterialNotes
from meshreel.formats.usd.materials import UV_READER, WRAPS, usd_translation
from meshreel.model.materials import AlphaMode, Image, Material, Texture
from meshreel.model.surface import FaceGroups
from meshreel.runtime.extras import USD

WRAP_TOKENS = {wrap: token for token, wrap in WRAPS.items()}
PACKAGE_TYPES = ("image/png", "image/jpeg", "image/x-exr", "image/avif")
"""Image types that USDZ packages may contain."""


def prim_name(name: str) -> str:
    """Return the name with ``_`` in place of characters that USD forbids; never empty."""
    is_allowed = USD.load("Sdf").Path.IsValidIdentifier
    cleaned = "".join(char if is_allowed(f"_{char}") else "_" for char in name) or "mesh"
    return cleaned if is_allowed(cleaned) else f"_{cleaned}"


def unique_name(name: str, used: set[str]) -> str:
    """Return the name, with a number appended if it is in use, and add it to `used`."""
    unique, number = name, 2
    while unique in used:
        unique, number = f"{name}_{number}", number + 1
    used.add(unique)
    return unique


class TextureWriter:
    """Writes textures below materials.

    Parameters
    ----------
    stage : Usd.Stage
    images : sequence of Image
    paths : sequence of str
        File of each image, relative to that of the stage.
    primvars : mapping of str to str
        Primvar of each UV set.
    is_package : bool
        Whether images go into a USDZ package, which supports only some types.
    """

    def __init__(
        self,
        stage: Any,
        images: Sequence[Image],
        paths: Sequence[str],
        primvars: Mapping[str, str],
        *,
        is_package: bool,
    ) -> None:
        self._stage, self._images, self._paths = stage, images, paths
        self._primvars, self._is_package = primvars, is_package

    def write(self, material: Any, look: Material, notes: MaterialNotes) -> dict[str, Any]:
        """Write the textures of a material, and return the shader outputs for its inputs, by slot.

        The slot "alpha" is the alpha of the base color.

        Parameters
        ----------
        material : UsdShade.Material
            Parent of the texture shaders.
        notes : MaterialNotes
            Gains a sentence for each property that USD cannot store.
        """
        outputs: dict[str, Any] = {}
        for slot, texture in look.textures.items():
            if reason := self._unsupported_reason(texture):
                notes.add(f"textures that USD cannot store ({reason})", look.name)
                continue
            if texture.magnified or texture.shrunk:
                notes.add("texture filters, which USD cannot store", look.name)
            shader = self._texture(f"{material.GetPath()}/{slot}_texture", texture)
            self._write_scale(shader, slot, look)
            is_color = len(texture.channels) >= 3
            types = USD.load("Sdf").ValueTypeNames
            output = ("rgb", types.Float3) if is_color else (texture.channels, types.Float)
            outputs[slot] = shader.CreateOutput(*output)
            if slot == "base_color" and _has_alpha(look):
                outputs["alpha"] = shader.CreateOutput("a", types.Float)
        return outputs

    def _unsupported_reason(self, texture: Texture) -> str:
        mime_type = self._images[texture.image].mime_type
        if self._is_package and mime_type not in PACKAGE_TYPES:
            return f"packages do not support {mime_type}"
        if texture.uv not in self._primvars:
            return f"there are no UVs {texture.uv!r}"
        return ""

    def _texture(self, path: str, texture: Texture) -> Any:
        sdf = USD.load("Sdf")
        types = sdf.ValueTypeNames
        shader = self._shader(path, "UsdUVTexture")
        shader.CreateInput("file", types.Asset).Set(sdf.AssetPath(self._paths[texture.image]))
        shader.CreateInput("st", types.Float2).ConnectToSource(self._coordinates(path, texture))
        shader.CreateInput("wrapS", types.Token).Set(WRAP_TOKENS[texture.wrap_u])
        shader.CreateInput("wrapT", types.Token).Set(WRAP_TOKENS[texture.wrap_v])
        return shader

    def _coordinates(self, path: str, texture: Texture) -> Any:
        types, primvar = USD.load("Sdf").ValueTypeNames, self._primvars[texture.uv]
        parent = path.rpartition("/")[0]
        reader = self._shader(f"{parent}/uv_{prim_name(primvar)}", UV_READER)
        reader.CreateInput("varname", types.String).Set(primvar)
        result = reader.CreateOutput("result", types.Float2)
        if not texture.is_placed:
            return result
        transform = self._shader(f"{path}_transform", "UsdTransform2d")
        transform.CreateInput("in", types.Float2).ConnectToSource(result)
        transform.CreateInput("rotation", types.Float).Set(math.degrees(texture.rotation))
        transform.CreateInput("scale", types.Float2).Set(texture.scale)
        transform.CreateInput("translation", types.Float2).Set(usd_translation(texture))
        return transform.CreateOutput("result", types.Float2)

    def _write_scale(self, shader: Any, slot: str, look: Material) -> None:
        """Write the color space, scale and bias of a texture."""
        types = USD.load("Sdf").ValueTypeNames
        is_color = slot in ("base_color", "emissive")
        shader.CreateInput("sourceColorSpace", types.Token).Set("sRGB" if is_color else "raw")
        scale, bias = _scale_and_bias(slot, look)
        if scale != (1.0,) * 4:
            shader.CreateInput("scale", types.Float4).Set(scale)
        if bias != (0.0,) * 4:
            shader.CreateInput("bias", types.Float4).Set(bias)

    def _shader(self, path: str, kind: str) -> Any:
        shader = USD.load("UsdShade").Shader.Define(self._stage, path)
        shader.CreateIdAttr(kind)
        return shader


def _has_alpha(look: Material) -> bool:
    texture = look.base_color_texture
    has_alpha_channel = texture is not None and texture.channels == "rgba"
    return has_alpha_channel and look.alpha_mode is not AlphaMode.OPAQUE


def _scale_and_bias(slot: str, look: Material) -> tuple[tuple[float, ...], tuple[float, ...]]:
    no_bias = (0.0,) * 4
    if slot == "base_color":
        return (*look.base_color[:3], look.base_color[3] if _has_alpha(look) else 1.0), no_bias
    if slot == "emissive":
        return (*look.emissive, 1.0), no_bias
    if slot == "normal":
        scale = look.normal_scale
        return (2 * scale, 2 * scale, 2.0, 1.0), (-scale, -scale, -1.0, 0.0)
    if slot == "occlusion":
        strength = look.occlusion_strength
        return (strength,) * 4, (1 - strength,) * 4
    return ({"metallic": look.metallic, "roughness": look.roughness}[slot],) * 4, no_bias


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
