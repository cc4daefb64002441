"""Materials of a stage, of what UsdPreviewSurface says."""

from dataclasses import replace
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.notes import LookNotes
from meshreel.formats.usd.shading_inputs import Source, numbers, source_of
from meshreel.formats.usd.stage_images import StageImages
from meshreel.formats.usd.texture_reading import FoundTexture, read_texture
from meshreel.model.materials import AlphaMode, Material

INPUTS = {
    "base_color": ("diffuseColor", (0.18, 0.18, 0.18)),
    "metallic": ("metallic", (0.0,)),
    "roughness": ("roughness", (0.5,)),
    "normal": ("normal", (0.0, 0.0, 1.0)),
    "occlusion": ("occlusion", (1.0,)),
    "emissive": ("emissiveColor", (0.0, 0.0, 0.0)),
}
"""Inputs that may have textures, by what they are of, and what they are where a file is silent."""

UNKEPT = {
    "useSpecularWorkflow": (0.0,),
    "specularColor": (0.0, 0.0, 0.0),
    "clearcoat": (0.0,),
    "clearcoatRoughness": (0.01,),
    "ior": (1.5,),
    "displacement": (0.0,),
}
IDENTITY = (1.0,) * 4, (0.0,) * 4


class PreviewSurface:
    """The look of a material, as a shader describes it.

    Parameters
    ----------
    shader : UsdShade.Shader
    name : str
        Of the material, for the notes.
    notes : LookNotes
        Gains what is not kept.
    """

    def __init__(self, shader: Any, name: str, images: StageImages, notes: LookNotes) -> None:
        self._shader, self._name = shader, name
        self._images, self._notes = images, notes
        self._sources = {slot: self._source(told) for slot, (told, _) in INPUTS.items()}
        self._textures = {
            slot: found
            for slot, source in self._sources.items()
            if source.shader and (found := self._texture(slot, source)) is not None
        }

    def material(self) -> Material:
        """The material, without a name."""
        for name, usual in UNKEPT.items():
            source = self._source(name)
            if source.shader or not np.allclose(self._numbers(name, source, usual), usual):
                self._left_out(f"{name} of UsdPreviewSurface")
        opacity, threshold = self._source("opacity"), self._value("opacityThreshold", 0.0)
        has_alpha = self._is_alpha_of_color(opacity)
        red, green, blue = self._factor("base_color", 3)
        alpha = self._alpha(opacity, has_alpha=has_alpha)
        mode = AlphaMode.BLEND if has_alpha or alpha < 1 else AlphaMode.OPAQUE
        (metallic,), (roughness,) = self._factor("metallic", 1), self._factor("roughness", 1)
        glow = self._factor("emissive", 3)
        textures = {slot: found.texture for slot, found in self._textures.items()}
        if has_alpha:
            textures["base_color"] = replace(textures["base_color"], channels="rgba")
        return Material(
            "",
            base_color=(red, green, blue, alpha),
            metallic=metallic,
            roughness=roughness,
            emissive=(glow[0], glow[1], glow[2]),
            normal_scale=self._normal_scale(),
            occlusion_strength=self._occlusion_strength(),
            alpha_mode=AlphaMode.MASK if threshold > 0 else mode,
            alpha_cutoff=threshold if threshold > 0 else 0.5,
        ).with_textures(textures)

    def _source(self, name: str) -> Source:
        found = source_of(self._shader, name)
        if found.is_moving:
            self._left_out(f"changes of {name} over time")
        return found

    def _texture(self, slot: str, source: Source) -> FoundTexture | None:
        name, usual = INPUTS[slot]
        try:
            found = read_texture(source, self._images)
            if (found.texture.channels == "rgb") != (len(usual) == 3):
                raise FormatError(f"it takes {found.texture.channels}")
        except FormatError as error:
            self._left_out(f"the texture of {name} ({error})")
            return None
        expected = "sRGB" if slot in ("base_color", "emissive") else "raw"
        if found.color_space not in ("auto", expected):
            self._left_out(f"color space {found.color_space[:60]!r} of the texture of {name}")
        if slot not in ("normal", "occlusion") and found.bias != IDENTITY[1]:
            self._left_out(f"bias of the texture of {name}")
        return found

    def _numbers(self, name: str, source: Source, usual: tuple[float, ...]) -> tuple[float, ...]:
        try:
            return numbers(source, usual, name)
        except FormatError as error:
            self._left_out(f"an input that is damaged ({error})")
            return usual

    def _value(self, name: str, usual: float) -> float:
        return self._numbers(name, self._source(name), (usual,))[0]

    def _factor(self, slot: str, width: int) -> tuple[float, ...]:
        """The factor of the texture; the value if there is no texture."""
        if slot not in self._textures:
            name, usual = INPUTS[slot]
            return self._numbers(name, self._sources[slot], usual)
        found = self._textures[slot]
        if width == 3:
            return found.scale[:3]
        return (found.scale["rgba".index(found.texture.channels)],)

    def _is_alpha_of_color(self, opacity: Source) -> bool:
        if not opacity.shader:
            return False
        is_same = opacity.path == self._sources["base_color"].path and opacity.output == "a"
        if is_same and "base_color" in self._textures:
            return True
        self._left_out("opacity that is not the alpha of the color's image")
        return False

    def _alpha(self, opacity: Source, *, has_alpha: bool) -> float:
        if has_alpha:
            return self._textures["base_color"].scale[3]
        return self._numbers("opacity", opacity, (1.0,))[0]

    def _normal_scale(self) -> float:
        found = self._textures.get("normal")
        if found is None:
            name, usual = INPUTS["normal"]
            if self._numbers(name, self._sources["normal"], usual) != usual:
                self._left_out("normal that is the same everywhere")
            return 1.0
        # Images of normals hold -1..1 as 0..1, whether a file says so or not.
        if (found.scale, found.bias) == IDENTITY:
            return 1.0
        scale = found.scale[0] / 2
        expected = (2 * scale, 2 * scale, 2.0), (-scale, -scale, -1.0)
        if not np.allclose((found.scale[:3], found.bias[:3]), expected):
            self._left_out("scale and bias of the texture of normal")
            return 1.0
        return scale

    def _occlusion_strength(self) -> float:
        found = self._textures.get("occlusion")
        if found is None:
            value = self._numbers("occlusion", self._sources["occlusion"], (1.0,))
            if value != (1.0,):
                self._left_out("occlusion that is the same everywhere")
            return 1.0
        place = "rgba".index(found.texture.channels)
        strength = found.scale[place]
        if abs(found.bias[place] - (1 - strength)) > 1e-6:
            self._left_out("scale and bias of the texture of occlusion")
            return 1.0
        return strength

    def _left_out(self, what: str) -> None:
        self._notes.add(what, self._name)
