"""Reading UsdPreviewSurface shaders as materials."""

from dataclasses import replace
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.notes import MaterialNotes
from meshreel.formats.usd.shading_inputs import Source, read_numbers, source_of
from meshreel.formats.usd.stage_images import StageImages
from meshreel.formats.usd.texture_reading import ScaledTexture, read_texture
from meshreel.model.materials import AlphaMode, Material

INPUTS = {
    "base_color": ("diffuseColor", (0.18, 0.18, 0.18)),
    "metallic": ("metallic", (0.0,)),
    "roughness": ("roughness", (0.5,)),
    "normal": ("normal", (0.0, 0.0, 1.0)),
    "occlusion": ("occlusion", (1.0,)),
    "emissive": ("emissiveColor", (0.0, 0.0, 0.0)),
}
"""Shader inputs that may have textures, and their defaults, by texture slot."""

UNSUPPORTED = {
    "useSpecularWorkflow": (0.0,),
    "specularColor": (0.0, 0.0, 0.0),
    "clearcoat": (0.0,),
    "clearcoatRoughness": (0.01,),
    "ior": (1.5,),
    "displacement": (0.0,),
}
IDENTITY = (1.0,) * 4, (0.0,) * 4
"""Scale and bias that leave a texture unchanged."""


class PreviewSurface:
    """The appearance of a material, as defined by a UsdPreviewSurface shader.

    Parameters
    ----------
    shader : UsdShade.Shader
    name : str
        Name of the material, for the notes.
    notes : MaterialNotes
        Gains unsupported properties.
    """

    def __init__(self, shader: Any, name: str, images: StageImages, notes: MaterialNotes) -> None:
        self._shader, self._name = shader, name
        self._images, self._notes = images, notes
        self._sources = {slot: self._source(name) for slot, (name, _) in INPUTS.items()}
        self._textures = {
            slot: texture
            for slot, source in self._sources.items()
            if source.shader and (texture := self._texture(slot, source)) is not None
        }

    def material(self) -> Material:
        """Return the material, unnamed."""
        for name, default in UNSUPPORTED.items():
            source = self._source(name)
            if source.shader or not np.allclose(self._numbers(name, source, default), default):
                self._note(f"{name} of UsdPreviewSurface")
        opacity, threshold = self._source("opacity"), self._value("opacityThreshold", 0.0)
        has_alpha = self._is_alpha_of_color(opacity)
        red, green, blue = self._factor("base_color", 3)
        alpha = self._alpha(opacity, has_alpha=has_alpha)
        mode = AlphaMode.BLEND if has_alpha or alpha < 1 else AlphaMode.OPAQUE
        (metallic,), (roughness,) = self._factor("metallic", 1), self._factor("roughness", 1)
        emissive = self._factor("emissive", 3)
        textures = {slot: texture.texture for slot, texture in self._textures.items()}
        if has_alpha:
            textures["base_color"] = replace(textures["base_color"], channels="rgba")
        return Material(
            "",
            base_color=(red, green, blue, alpha),
            metallic=metallic,
            roughness=roughness,
            emissive=(emissive[0], emissive[1], emissive[2]),
            normal_scale=self._normal_scale(),
            occlusion_strength=self._occlusion_strength(),
            alpha_mode=AlphaMode.MASK if threshold > 0 else mode,
            alpha_cutoff=threshold if threshold > 0 else 0.5,
        ).with_textures(textures)

    def _source(self, name: str) -> Source:
        source = source_of(self._shader, name)
        if source.is_animated:
            self._note(f"changes of {name} over time")
        return source

    def _texture(self, slot: str, source: Source) -> ScaledTexture | None:
        name, default = INPUTS[slot]
        try:
            texture = read_texture(source, self._images)
            if (texture.texture.channels == "rgb") != (len(default) == 3):
                raise FormatError(f"it has the channels {texture.texture.channels}")
        except FormatError as error:
            self._note(f"the texture of {name} ({error})")
            return None
        expected = "sRGB" if slot in ("base_color", "emissive") else "raw"
        if texture.color_space not in ("auto", expected):
            self._note(f"color space {texture.color_space[:60]!r} of the texture of {name}")
        if slot not in ("normal", "occlusion") and texture.bias != IDENTITY[1]:
            self._note(f"bias of the texture of {name}")
        return texture

    def _numbers(self, name: str, source: Source, default: tuple[float, ...]) -> tuple[float, ...]:
        try:
            return read_numbers(source, default, name)
        except FormatError as error:
            self._note(f"invalid inputs ({error})")
            return default

    def _value(self, name: str, default: float) -> float:
        return self._numbers(name, self._source(name), (default,))[0]

    def _factor(self, slot: str, width: int) -> tuple[float, ...]:
        """Return the factor on the texture, or the value if there is no texture."""
        if slot not in self._textures:
            name, default = INPUTS[slot]
            return self._numbers(name, self._sources[slot], default)
        texture = self._textures[slot]
        if width == 3:
            return texture.scale[:3]
        return (texture.scale["rgba".index(texture.texture.channels)],)

    def _is_alpha_of_color(self, opacity: Source) -> bool:
        if not opacity.shader:
            return False
        is_same = opacity.path == self._sources["base_color"].path and opacity.output == "a"
        if is_same and "base_color" in self._textures:
            return True
        self._note("opacity that is not the alpha of the color texture")
        return False

    def _alpha(self, opacity: Source, *, has_alpha: bool) -> float:
        if has_alpha:
            return self._textures["base_color"].scale[3]
        return self._numbers("opacity", opacity, (1.0,))[0]

    def _normal_scale(self) -> float:
        texture = self._textures.get("normal")
        if texture is None:
            name, default = INPUTS["normal"]
            if self._numbers(name, self._sources["normal"], default) != default:
                self._note("constant normal")
            return 1.0
        # Normal maps store -1..1 as 0..1, even if scale and bias are missing.
        if (texture.scale, texture.bias) == IDENTITY:
            return 1.0
        scale = texture.scale[0] / 2
        expected = (2 * scale, 2 * scale, 2.0), (-scale, -scale, -1.0)
        if not np.allclose((texture.scale[:3], texture.bias[:3]), expected):
            self._note("scale and bias of the texture of normal")
            return 1.0
        return scale

    def _occlusion_strength(self) -> float:
        texture = self._textures.get("occlusion")
        if texture is None:
            value = self._numbers("occlusion", self._sources["occlusion"], (1.0,))
            if value != (1.0,):
                self._note("constant occlusion")
            return 1.0
        channel = "rgba".index(texture.texture.channels)
        strength = texture.scale[channel]
        if abs(texture.bias[channel] - (1 - strength)) > 1e-6:
            self._note("scale and bias of the texture of occlusion")
            return 1.0
        return strength

    def _note(self, what: str) -> None:
        self._notes.add(what, self._name)
