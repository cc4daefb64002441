"""Materials of a glTF file: how they look, and what of that is not kept."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache, cached_property

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.gltf.buffers import EXPANSION, LEAST_DECODED_BYTES, Buffers
from meshreel.formats.gltf.document import Document
from meshreel.formats.gltf.image_reading import PACKED, image_number, read_image
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.material_values import STRENGTH, UNLIT, read_look, read_texture, sampled
from meshreel.formats.gltf.nodes import unique_names
from meshreel.formats.gltf.primitives import surfaces
from meshreel.formats.gltf.specular_glossiness import (
    SPECULAR_GLOSSINESS,
    SPECULAR_TEXTURE,
    specular_glossiness,
)
from meshreel.formats.notes import GatheredNote, LookNotes, listed, note_left_out
from meshreel.model.materials import UNSAID, Image, Material, Texture, used_by

VARIANTS = "KHR_materials_variants"
KEPT = {UNLIT, STRENGTH}

LIT_TEXTURES = {
    "normal": ("normalTexture", "rgb"),
    "occlusion": ("occlusionTexture", "r"),
    "emissive": ("emissiveTexture", "rgb"),
}
DIFFUSE_TEXTURES = {"base_color": ("diffuseTexture", "rgba")}
PBR_TEXTURES = {
    "base_color": ("baseColorTexture", "rgba"),
    "metallic": ("metallicRoughnessTexture", "b"),
    "roughness": ("metallicRoughnessTexture", "g"),
}
"""Keys of textures, and the channels of the image that count."""
WITHOUT_TEXTURE = "specular-glossiness textures, replaced by metalness 0 and half the glossiness"


class MaterialReader:
    """The materials of a file, and the images that they show, each read when it is first needed.

    Parameters
    ----------
    notes : list of str
        Gains a sentence for each look or image that is damaged or missing, which is left out.
    """

    def __init__(self, document: Document, buffers: Buffers, notes: list[str]) -> None:
        self._document, self._buffers = document, buffers
        self._notes = LookNotes(notes)
        self._converted = GatheredNote(notes, _describe_converted)
        self._n_bytes = 0
        self._places: dict[str, int] = {}
        self._images: list[Image] = []
        self._read = cache(self._read_material)
        self._image = cache(self._read_image)

    @cached_property
    def labels(self) -> list[str]:
        """The name of each, no two alike; empty for one that says nothing."""
        given = [one.text("name", "") for one in self._document.lists["materials"]]
        # A single one without a name that looks like any other says nothing; several tell faces
        # apart.
        wants_notes = given.count("") > 1 or self._has_unnamed_look(given)
        named = [name or f"material_{i}" for i, name in enumerate(given) if name or wants_notes]
        unique = iter(unique_names(named))
        return [next(unique) if name or wants_notes else "" for name in given]

    def look(self, numbers: Iterable[int]) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """The materials of these numbers that have labels, and the images that they show."""
        found = {number: self._read(number) for number in numbers}
        named = [
            replace(one, name=self.labels[number])
            for number, one in found.items()
            if one is not None and self.labels[number]
        ]
        return used_by([one.name for one in named], named, self._images)

    def _has_unnamed_look(self, names: Sequence[str]) -> bool:
        if "" not in names:
            return False
        look = self._read(names.index(""))
        return look not in (None, Material(""), UNSAID)

    def _read_material(self, number: int) -> Material | None:
        given = self._document.lists["materials"][number]
        try:
            return self._with_textures(read_look(given), given)
        except FormatError as error:
            self._notes.add("how materials look", str(error))
            return None

    def _with_textures(self, look: Material, given: JsonObject) -> Material:
        pbr, other = given.child("pbrMetallicRoughness"), specular_glossiness(given)
        if other is not None:
            name = given.text("name", "") or given.place
            self._converted.add(name)
            if SPECULAR_TEXTURE in other:
                self._notes.add(WITHOUT_TEXTURE, name)
        found = {}
        for holder, keys in (
            (pbr, PBR_TEXTURES), (other, DIFFUSE_TEXTURES), (given, LIT_TEXTURES),
        ):  # fmt: skip
            for slot, (key, channels) in keys.items():
                told = None if holder is None else holder.child(key)
                if told is not None and (texture := self._texture(told, channels)) is not None:
                    found[slot] = texture
        return look.with_textures(found)

    def _texture(self, told: JsonObject, channels: str) -> Texture | None:
        """A texture, whose image is one of those read so far; None if the image cannot be had."""
        lists = self._document.lists
        texture = self._document.item(told, "index", "textures")
        sampler = self._document.index(texture, "sampler", "samplers")
        image = self._image(image_number(texture, len(lists["images"])))
        if image is None:
            return None
        found = read_texture(told, image, channels)
        return found if sampler is None else sampled(found, lists["samplers"][sampler])

    def _read_image(self, number: int) -> int | None:
        """Which one of the images read so far it is."""
        given = self._document.lists["images"][number]
        place = repr((given.values.get("bufferView"), given.values.get("uri")))
        if place not in self._places:
            try:
                self._images.append(self._checked(read_image(given, self._buffers), given))
            except (FormatError, InvalidInputError) as error:
                self._notes.add("texture images", str(error))
                return None
            self._places[place] = len(self._images) - 1
        return self._places[place]

    def _checked(self, image: Image, given: JsonObject) -> Image:
        """The image, unless images share bytes of a buffer and would fill the memory together."""
        if "bufferView" not in given:
            return image
        self._n_bytes += len(image.data)
        allowed = max(LEAST_DECODED_BYTES, EXPANSION * self._buffers.size_bytes)
        if self._n_bytes > allowed:
            raise FormatError(
                f"{given.place}: images take {self._n_bytes} bytes; allowed are {allowed}"
            )
        return image


def _describe_converted(names: Sequence[str]) -> str:
    return f"converted from specular-glossiness to metallic-roughness: {listed(names)}"


def note_unkept(document: Document, meshes: Sequence[JsonObject], notes: list[str]) -> None:
    """Add to the notes which extensions of the materials of some meshes are not kept."""
    lists = document.lists
    primitives = [one for mesh in meshes for one in surfaces(mesh)]
    numbers = {document.index(one, "material", "materials") for one in primitives}
    found: dict[str, list[str]] = {}
    for number in sorted(one for one in numbers if one is not None):
        given = lists["materials"][number]
        called = given.text("name", "") or f"material {number}"
        converted = set() if "pbrMetallicRoughness" in given else {SPECULAR_GLOSSINESS}
        for name in _extensions(given) - KEPT - converted:
            found.setdefault(name, []).append(called)
    if any(one.extension(VARIANTS) is not None for one in primitives):
        found[VARIANTS] = ["other materials of the same faces"]
    for texture in lists["textures"]:
        for name in _extensions(texture):
            if name not in PACKED or "source" in texture:
                found.setdefault(name, []).append(texture.place)
    if found:
        told = listed(f"{name} ({listed(found[name], 3)})" for name in sorted(found))
        note_left_out(notes, f"extensions of materials: {told}")


def _extensions(given: JsonObject) -> set[str]:
    extensions = given.values.get("extensions")
    return set(extensions) if isinstance(extensions, dict) else set()
