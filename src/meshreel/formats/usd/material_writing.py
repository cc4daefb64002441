"""Writing materials of a stage: UsdPreviewSurface with its textures."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from meshreel.errors import Keyword, Message
from meshreel.formats.scenes.parts import unique_name
from meshreel.formats.usd.materials import NO_BIAS, NO_SCALE, UV_READER, WRAPS
from meshreel.model.materials import AlphaMode, Image, Material, Texture
from meshreel.model.notes import Notes
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


def set_display_name(prim: Any, label: str) -> None:
    """Set the display name of a prim, if it differs from its name."""
    if prim.GetName() != label:
        prim.SetDisplayName(label)


class Materials:
    """The materials of a stage, each created when it is first bound.

    Parameters
    ----------
    root : str
        Path of the prim above the materials.
    used : set of str
        Names of existing prims below the root.
    looks : sequence of Material
        Materials with a known appearance; others are bound by name only.
    images : sequence of tuple of Image and str
        Images of the textures, with paths of their files relative to the file of the stage.
    primvars : mapping of str to str
        Primvar of each UV set.
    notes : Notes
        Gains a sentence for each kind of property that USD cannot store.
    is_package : bool
        Whether images go into a USDZ package, which supports only some types.
    """

    def __init__(
        self,
        stage: Any,
        root: str,
        used: set[str],
        looks: Sequence[Material],
        images: Sequence[tuple[Image, str]],
        primvars: Mapping[str, str],
        notes: Notes,
        *,
        is_package: bool,
    ) -> None:
        self._stage, self._images, self._primvars = stage, images, primvars
        self._scope = f"{root}/{unique_name('Materials', used)}"
        self._names: set[str] = set()
        self._created: dict[str, Any] = {}
        self._looks = {look.name: look for look in looks}
        self._notes, self._is_package = notes, is_package
        self._types = USD.load("Sdf").ValueTypeNames

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
        looks = [self._looks[label] for label in groups.labels if label in self._looks]
        if not looks:
            return
        is_double = any(look.double_sided for look in looks)
        USD.load("UsdGeom").Gprim(prim).CreateDoubleSidedAttr(is_double)
        single_sided = [look.name for look in looks if is_double and not look.double_sided]
        subject = "single-sidedness of materials on meshes with double-sided ones"
        self._notes.left_out(subject, single_sided)

    def note_unused(self) -> None:
        """Note the materials that no face uses."""
        unused = (name for name in self._looks if name not in self._created)
        self._notes.left_out("materials that no face uses", unused)

    def _write(self, material: Any, look: Material) -> None:
        """Write the appearance of a material."""
        types, path = self._types, material.GetPath()
        shader = self._shader(f"{path}/surface", "UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        outputs: dict[str, Any] = {}
        for slot, texture in look.textures.items():
            if reason := self._unsupported_reason(texture):
                self._notes.left_out(f"textures that USD cannot store ({reason})", [look.name])
                continue
            if texture.magnified or texture.shrunk:
                self._notes.left_out("texture filters, which USD cannot store", [look.name])
            reader = self._texture(f"{path}/{slot}_texture", slot, texture, look)
            is_color = len(texture.channels) >= 3
            output = ("rgb", types.Float3) if is_color else (texture.channels, types.Float)
            outputs[slot] = reader.CreateOutput(*output)
            if slot == "base_color" and _has_alpha(look):
                outputs["opacity"] = reader.CreateOutput("a", types.Float)
        inputs = (
            ("base_color", "diffuseColor", types.Color3f, look.base_color[:3]),
            ("metallic", "metallic", types.Float, look.metallic),
            ("roughness", "roughness", types.Float, look.roughness),
            ("emissive", "emissiveColor", types.Color3f, look.emissive),
            ("normal", "normal", types.Normal3f, None),
            ("occlusion", "occlusion", types.Float, None),
            ("opacity", "opacity", types.Float, look.base_color[3]),
        )
        for slot, name, kind, value in inputs:
            if slot == "opacity" and look.alpha_mode is AlphaMode.OPAQUE:
                continue
            if slot in outputs:
                shader.CreateInput(name, kind).ConnectToSource(outputs[slot])
            elif value is not None:
                shader.CreateInput(name, kind).Set(value)
        if look.alpha_mode is AlphaMode.MASK:
            shader.CreateInput("opacityThreshold", types.Float).Set(look.alpha_cutoff)
        if look.unlit:
            self._notes.left_out("unlit shading of materials, which USD cannot store", [look.name])

    def _unsupported_reason(self, texture: Texture) -> str:
        mime_type = self._images[texture.image][0].mime_type
        if mime_type not in PACKAGE_TYPES:
            text = f"programs that read USD may not show {mime_type}; for PNG use "
            self._notes.result(text, Message(text, Keyword("images", "png")))
            if self._is_package:
                return f"packages do not support {mime_type}"
        return "" if texture.uv in self._primvars else f"there are no UVs {texture.uv!r}"

    def _texture(self, path: str, slot: str, texture: Texture, look: Material) -> Any:
        """Write the shaders of a texture, and return the shader that reads its image."""
        types, file = self._types, self._images[texture.image][1]
        shader = self._shader(path, "UsdUVTexture")
        shader.CreateInput("file", types.Asset).Set(USD.load("Sdf").AssetPath(file))
        shader.CreateInput("st", types.Float2).ConnectToSource(self._coordinates(path, texture))
        shader.CreateInput("wrapS", types.Token).Set(WRAP_TOKENS[texture.wrap_u])
        shader.CreateInput("wrapT", types.Token).Set(WRAP_TOKENS[texture.wrap_v])
        is_color = slot in ("base_color", "emissive")
        shader.CreateInput("sourceColorSpace", types.Token).Set("sRGB" if is_color else "raw")
        scale, bias = _scale_and_bias(slot, look)
        if scale != NO_SCALE:
            shader.CreateInput("scale", types.Float4).Set(scale)
        if bias != NO_BIAS:
            shader.CreateInput("bias", types.Float4).Set(bias)
        return shader

    def _coordinates(self, path: str, texture: Texture) -> Any:
        types, primvar = self._types, self._primvars[texture.uv]
        parent = path.rpartition("/")[0]
        reader = self._shader(f"{parent}/uv_{prim_name(primvar)}", UV_READER)
        reader.CreateInput("varname", types.String).Set(primvar)
        result = reader.CreateOutput("result", types.Float2)
        if not texture.is_placed:
            return result
        angle, scale_v = texture.rotation, texture.scale[1]
        translation = (  # v points up in USD
            texture.offset[0] + math.sin(angle) * scale_v,
            1 - texture.offset[1] - math.cos(angle) * scale_v,
        )
        transform = self._shader(f"{path}_transform", "UsdTransform2d")
        transform.CreateInput("in", types.Float2).ConnectToSource(result)
        transform.CreateInput("rotation", types.Float).Set(math.degrees(angle))
        transform.CreateInput("scale", types.Float2).Set(texture.scale)
        transform.CreateInput("translation", types.Float2).Set(translation)
        return transform.CreateOutput("result", types.Float2)

    def _shader(self, path: str, kind: str) -> Any:
        shader = USD.load("UsdShade").Shader.Define(self._stage, path)
        shader.CreateIdAttr(kind)
        return shader


def _has_alpha(look: Material) -> bool:
    texture = look.base_color_texture
    has_alpha_channel = texture is not None and texture.channels == "rgba"
    return has_alpha_channel and look.alpha_mode is not AlphaMode.OPAQUE


def _scale_and_bias(slot: str, look: Material) -> tuple[tuple[float, ...], tuple[float, ...]]:
    if slot == "base_color":
        return (*look.base_color[:3], look.base_color[3] if _has_alpha(look) else 1.0), NO_BIAS
    if slot == "emissive":
        return (*look.emissive, 1.0), NO_BIAS
    if slot == "normal":
        scale = look.normal_scale
        return (2 * scale, 2 * scale, 2.0, 1.0), (-scale, -scale, -1.0, 0.0)
    if slot == "occlusion":
        strength = look.occlusion_strength
        return (strength,) * 4, (1 - strength,) * 4
    return ({"metallic": look.metallic, "roughness": look.roughness}[slot],) * 4, NO_BIAS
