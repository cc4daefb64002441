"""Materials as they stand in a glTF file."""

from collections.abc import Sequence
from dataclasses import replace

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.material_reading import LIT_TEXTURES
from meshreel.formats.gltf.material_values import ALPHA_CODES, STRENGTH, UNLIT
from meshreel.formats.gltf.texture_writer import Textures, unless
from meshreel.formats.notes import note_left_out
from meshreel.model.materials import UNSAID, AlphaMode, Material, Texture
from meshreel.model.surface import Surface


class Materials:
    """Materials by their labels, each written once.

    Parameters
    ----------
    buffer : BufferWriter
        Gains the images.
    notes : list of str
        Gains a sentence for each thing that glTF cannot have.

    Attributes
    ----------
    listed : list of dict
        As they stand in the JSON.
    textures : Textures
    """

    def __init__(self, surface: Surface, buffer: BufferWriter, notes: list[str]) -> None:
        self.listed: list[Json] = []
        self.textures = Textures(surface, buffer, notes)
        self._looks = {one.name: one for one in surface.materials}
        self._notes = notes
        self._numbers: dict[str | None, int] = {}

    def number(self, label: str | None) -> int:
        """That of a label, or of faces without one."""
        if label not in self._numbers:
            self._numbers[label] = len(self.listed)
            look = UNSAID if label is None else self._looks.get(label, UNSAID)
            self.listed.append(({"name": label} if label else {}) | self._written(look))
        return self._numbers[label]

    def document(self) -> Json:
        """The lists of the JSON that materials need."""
        textures = self.textures
        lists = {
            "materials": self.listed,
            "textures": textures.textures,
            "samplers": textures.samplers,
            "images": textures.images,
        }
        return {key: values for key, values in lists.items() if values}

    def note_unused(self) -> None:
        """Add to the notes which materials no face has."""
        if unused := [name for name in self._looks if name not in self._numbers]:
            note_left_out(self._notes, f"materials that no face has: {', '.join(unused)}")

    def _written(self, look: Material) -> Json:
        found: Json = {}
        if pbr := self._pbr(look):
            found["pbrMetallicRoughness"] = pbr
        for slot, (key, channels) in LIT_TEXTURES.items():
            if (told := self._texture(look, slot, channels)) is not None:
                found[key] = told
        if "normalTexture" in found:
            found["normalTexture"] |= unless(1.0, scale=look.normal_scale)
        if "occlusionTexture" in found:
            strength = self._within("occlusion strength", [look.occlusion_strength], look)[0]
            found["occlusionTexture"] |= unless(1.0, strength=strength)
        found |= self._emissive(look)
        if look.alpha_mode is not AlphaMode.OPAQUE:
            found["alphaMode"] = ALPHA_CODES[look.alpha_mode]
        if look.alpha_mode is AlphaMode.MASK:
            found |= unless(0.5, alphaCutoff=look.alpha_cutoff)
        if look.unlit:
            self.textures.used.add(UNLIT)
            found.setdefault("extensions", {})[UNLIT] = {}
        return found | unless(False, doubleSided=look.double_sided)

    def _pbr(self, look: Material) -> Json:
        color = self._within("base colour", look.base_color, look)
        metallic, roughness = self._within(
            "metallic or roughness", [look.metallic, look.roughness], look
        )
        found = unless([1.0] * 4, baseColorFactor=color)
        found |= unless(1.0, metallicFactor=metallic, roughnessFactor=roughness)
        color_channels = "rgb" if look.alpha_mode is AlphaMode.OPAQUE else "rgba"
        if (told := self._texture(look, "base_color", color_channels, "rgba")) is not None:
            found["baseColorTexture"] = told
        if (told := self._metallic_roughness(look)) is not None:
            found["metallicRoughnessTexture"] = told
        return found

    def _metallic_roughness(self, look: Material) -> Json | None:
        """The one texture of both; it must be the same for both, or one must not count."""
        metallic, roughness = look.textures.get("metallic"), look.textures.get("roughness")
        if metallic is None and roughness is None:
            return None
        is_one = _is_of(roughness, "g") and _is_of(metallic, "b") and _alike(roughness, metallic)
        is_rough = _is_of(roughness, "g") and metallic is None and look.metallic == 0
        is_metal = _is_of(metallic, "b") and roughness is None and look.roughness == 0
        texture = roughness or metallic
        if texture is not None and (is_one or is_rough or is_metal):
            return self.textures.told(texture, _called(look, "roughness"))
        note_left_out(
            self._notes,
            f"the metallic and roughness textures of material {look.name!r}: glTF has them as the "
            "blue and the green of one image",
        )
        return None

    def _emissive(self, look: Material) -> Json:
        strength = max(1.0, *look.emissive)
        scaled = [one / strength for one in look.emissive]
        found = unless([0.0] * 3, emissiveFactor=self._within("emissive", scaled, look))
        if strength > 1:
            self.textures.used.add(STRENGTH)
            found["extensions"] = {STRENGTH: {"emissiveStrength": strength}}
        return found

    def _texture(self, look: Material, slot: str, *channels: str) -> Json | None:
        texture = look.textures.get(slot)
        if texture is None:
            return None
        if texture.channels in channels:
            return self.textures.told(texture, _called(look, slot))
        if slot == "base_color":
            self._note(f"the alpha of {_called(look, slot)} counts, as glTF has it")
            return self.textures.told(texture, _called(look, slot))
        note_left_out(
            self._notes,
            f"{_called(look, slot)}: glTF has it in {channels[0]}, not {texture.channels}",
        )
        return None

    def _within(self, what: str, values: Sequence[float], look: Material) -> list[float]:
        clipped = [min(1.0, max(0.0, one)) for one in values]
        if clipped != list(values):
            self._note(f"{what} of material {look.name!r} is clipped to 0..1")
        return clipped

    def _note(self, note: str) -> None:
        if note not in self._notes:
            self._notes.append(note)


def _called(look: Material, slot: str) -> str:
    return f"the {slot.replace('_', ' ')} texture of material {look.name!r}"


def _is_of(texture: Texture | None, channel: str) -> bool:
    return texture is not None and texture.channels == channel


def _alike(one: Texture | None, other: Texture | None) -> bool:
    """Whether two textures differ in their channels only."""
    if one is None or other is None:
        return one is other
    return replace(one, channels="") == replace(other, channels="")
