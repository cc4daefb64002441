"""Images that a stage refers to, in its package or next to its file, as unchanged bytes."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.notes import MaterialNotes
from meshreel.formats.surfaces.images import image_type
from meshreel.model.materials import AlphaMode, Image, Material, Texture, Wrap, select_materials
from meshreel.model.surface import FaceGroups, Int32s
from meshreel.runtime.extras import USD


class StageImages:
    """Images of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Folder of the stage's file, which must contain the images; None allows any location.

    Attributes
    ----------
    images : list of Image
        The images read so far.
    """

    def __init__(self, folder: Path | None) -> None:
        self.images: list[Image] = []
        self._folder = None if folder is None else folder.resolve()
        self._indices: dict[str, int] = {}

    def index(self, asset: Any) -> int:
        """Return the index of an asset path in `images`, after reading it if necessary.

        Raises
        ------
        FormatError
            If the image cannot be read.
        """
        authored = str(getattr(asset, "path", ""))
        resolved = str(getattr(asset, "resolvedPath", ""))
        if resolved not in self._indices:
            if not resolved:
                raise FormatError(_why_unresolved(authored))
            self.images.append(self._image(authored, resolved))
            self._indices[resolved] = len(self.images) - 1
        return self._indices[resolved]

    def _image(self, authored: str, resolved: str) -> Image:
        resolver = USD.load("Ar")
        outer = resolved
        if resolver.IsPackageRelativePath(resolved):
            outer, _ = resolver.SplitPackageRelativePathOuter(resolved)
        if self._folder and not is_within(Path(outer), self._folder):
            raise outside_error(authored)
        if not Path(outer).is_file():
            raise FormatError(f"{authored[:200]!r} is not a file")
        opened = resolver.GetResolver().OpenAsset(resolver.ResolvedPath(resolved))
        if not opened:
            raise FormatError(f"{authored[:200]!r} cannot be read")
        data, name = bytes(opened.GetBuffer()), PurePosixPath(authored.rstrip("]"))
        return Image(name.stem, image_type(data, name.name), data)


def _why_unresolved(authored: str) -> str:
    if not authored:
        return "it names no file"
    if "<UDIM>" in authored:
        return f"{authored[:200]!r} consists of many tiles"
    return f"{authored[:200]!r} does not exist"


WRAPS = {
    "repeat": Wrap.REPEAT,
    "mirror": Wrap.MIRROR,
    "clamp": Wrap.CLAMP,
    "black": Wrap.BLACK,
    "useMetadata": Wrap.METADATA,
}
UV_READER = "UsdPrimvarReader_float2"
CHANNELS = ("rgb", "r", "g", "b", "a")

INPUTS: dict[str, tuple[str, tuple[float, ...]]] = {
    "base_color": ("diffuseColor", (0.18, 0.18, 0.18)),
    "metallic": ("metallic", (0.0,)),
    "roughness": ("roughness", (0.5,)),
    "normal": ("normal", (0.0, 0.0, 1.0)),
    "occlusion": ("occlusion", (1.0,)),
    "emissive": ("emissiveColor", (0.0, 0.0, 0.0)),
}
"""Shader inputs that may have textures, and their defaults, by texture slot."""

UNSUPPORTED: dict[str, tuple[float, ...]] = {
    "useSpecularWorkflow": (0.0,),
    "specularColor": (0.0, 0.0, 0.0),
    "clearcoat": (0.0,),
    "clearcoatRoughness": (0.01,),
    "ior": (1.5,),
    "displacement": (0.0,),
}
IDENTITY = (1.0,) * 4, (0.0,) * 4
"""Scale and bias that leave a texture unchanged."""


@dataclass(frozen=True)
class Source:
    """The value of a shader input, or the shader output connected to it; empty if undeclared.

    Attributes
    ----------
    value : object
        None if the input is connected to a shader.
    shader : UsdShade.Shader, optional
    output : str
        Name of the connected output.
    is_animated : bool
        Whether the value may change over time.
    """

    value: Any = None
    shader: Any = None
    output: str = ""
    is_animated: bool = False

    @property
    def path(self) -> str:
        """Path of the connected shader; empty if there is none."""
        return str(self.shader.GetPath()) if self.shader else ""


def source_of(shader: Any, name: str) -> Source:
    """Return the source of a shader input, through the interface inputs of materials."""
    shading = USD.load("UsdShade")
    shader_input = shader.GetInput(name)
    producers = shader_input.GetValueProducingAttributes() if shader_input else []
    if not producers:
        return Source()
    (first, *_) = producers
    if shading.Utils.GetType(first.GetName()) == shading.AttributeType.Output:
        output = shading.Utils.GetBaseNameAndType(first.GetName())[0]
        return Source(None, shading.Shader(first.GetPrim()), str(output))
    earliest = USD.load("Usd").TimeCode.EarliestTime()
    return Source(first.Get(earliest), is_animated=first.ValueMightBeTimeVarying())


def read_numbers(source: Source, default: tuple[float, ...], name: str) -> tuple[float, ...]:
    """Return the numbers of an input, as many as the default, or else the default.

    Raises
    ------
    FormatError
        If the value is something else.
    """
    value = source.value
    if value is None:
        return default
    try:
        numbers = tuple(float(one) for one in (value if len(default) > 1 else [value]))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(default) or not all(map(math.isfinite, numbers)):
        raise FormatError(f"{name} must be {len(default)} finite numbers; got {str(value)[:60]!r}")
    return numbers


@dataclass(frozen=True)
class ScaledTexture:
    """A texture with scale and bias of its values.

    Attributes
    ----------
    scale, bias : tuple of 4 floats
    """

    texture: Texture
    scale: tuple[float, ...]
    bias: tuple[float, ...]
    color_space: str


def read_texture(source: Source, images: StageImages) -> ScaledTexture:
    """Return the texture connected to an input of a material.

    Raises
    ------
    FormatError
        If the source is not a texture, or its image cannot be read.
    """
    shader = source.shader
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind != "UsdUVTexture" or source.output not in CHANNELS:
        raise FormatError(f"{kind or 'a shader of unknown type'} is not supported")
    texture = Texture(
        images.index(source_of(shader, "file").value),
        channels=source.output,
        wrap_u=_wrap(shader, "wrapS"),
        wrap_v=_wrap(shader, "wrapT"),
    )
    return ScaledTexture(
        _with_coordinates(texture, source_of(shader, "st").shader),
        read_numbers(source_of(shader, "scale"), (1.0,) * 4, "its scale"),
        read_numbers(source_of(shader, "bias"), (0.0,) * 4, "its bias"),
        str(source_of(shader, "sourceColorSpace").value or "auto"),
    )


def _wrap(shader: Any, name: str) -> Wrap:
    wrap = str(source_of(shader, name).value or "useMetadata")
    if wrap not in WRAPS:
        raise FormatError(f"{name} is {wrap[:60]!r}; it must be one of {', '.join(WRAPS)}")
    return WRAPS[wrap]


def _with_coordinates(texture: Texture, shader: Any) -> Texture:
    """Return the texture with its primvar and transform, from the shader of its coordinates."""
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind == "UsdTransform2d":
        rotation = math.radians(
            read_numbers(source_of(shader, "rotation"), (0.0,), "its rotation")[0]
        )
        scale = read_numbers(source_of(shader, "scale"), (1.0, 1.0), "its scale")
        translation = read_numbers(source_of(shader, "translation"), (0.0, 0.0), "its translation")
        shader = source_of(shader, "in").shader
        kind = str(shader.GetShaderId() or "") if shader else ""
        texture = with_usd_transform(
            texture, rotation, (scale[0], scale[1]), (translation[0], translation[1])
        )
    if kind != UV_READER:
        raise FormatError(f"its coordinates come from {kind or 'no shader'}, not {UV_READER}")
    name = str(source_of(shader, "varname").value or "")
    if not name:
        raise FormatError(f"its {UV_READER} has no primvar name")
    return replace(texture, uv=name)


def with_usd_transform(
    texture: Texture, rotation: float, scale: tuple[float, float], translation: tuple[float, float]
) -> Texture:
    """Return the texture with a UV transform of USD, in which v points up; rotation in radians."""
    offset = (
        translation[0] - math.sin(rotation) * scale[1],
        1 - translation[1] - math.cos(rotation) * scale[1],
    )
    return replace(texture, offset=offset, rotation=rotation, scale=scale)


def usd_translation(texture: Texture) -> tuple[float, float]:
    """Return the translation of the UV transform in USD, in which v points up."""
    sine, cosine = math.sin(texture.rotation), math.cos(texture.rotation)
    scale_v = texture.scale[1]
    return texture.offset[0] + sine * scale_v, 1 - texture.offset[1] - cosine * scale_v


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


MATERIALS = "materialBind"
"""The subset family for material bindings."""

UNNAMED = "group"
"""Name of the group of subsets without a family."""


class StageMaterials:
    """The materials of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Folder of the stage's file, which must contain the images; None allows any location.
    notes : list of str
        Gains a sentence for each kind of material property that is not read.
    """

    def __init__(self, folder: Path | None, notes: list[str]) -> None:
        self._stage_images = StageImages(folder)
        self._notes = MaterialNotes(notes)
        self._looks: dict[str, Material | None] = {}

    @property
    def images(self) -> list[Image]:
        """The images read so far, to which materials refer."""
        return self._stage_images.images

    def look(self, material: Any) -> Material | None:
        """Return the appearance of a ``UsdShade.Material``, unnamed, or None if not readable.

        Materials of instances share one result.
        """
        path = str(material.GetPath())
        if path not in self._looks:
            self._looks[path] = self._read(material)
        return self._looks[path]

    def _read(self, material: Any) -> Material | None:
        name = label_of(material.GetPrim())
        shader, _, _ = material.ComputeSurfaceSource()
        if not shader:
            if any(output.HasConnectedSource() for output in material.GetOutputs()):
                self._notes.add("appearance of materials without UsdPreviewSurface", name)
            return None
        if shader.GetShaderId() != "UsdPreviewSurface":
            self._notes.add("appearance of materials other than UsdPreviewSurface", name)
            return None
        if any(material.GetOutput(one).HasConnectedSource() for one in ("displacement", "volume")
               if material.GetOutput(one)):  # fmt: skip
            self._notes.add("displacement and volumes of materials", name)
        return PreviewSurface(shader, name, self._stage_images, self._notes).material()


class MeshMaterials:
    """The materials of a mesh, by face label.

    Parameters
    ----------
    prim : Usd.Prim
        Prim of the mesh.
    materials : StageMaterials
        Materials of the stage.
    """

    def __init__(self, prim: Any, materials: StageMaterials) -> None:
        mesh = USD.load("UsdGeom").Gprim(prim)
        self._is_double_sided = bool(mesh.GetDoubleSidedAttr().Get())
        self._materials = materials
        self._looks: dict[str, Material | None] = {}

    def bound_label(self, prim: Any) -> str:
        """Return the label of the material bound to a prim; empty if there is none.

        Materials with the same name but different appearance get different labels.
        """
        material, _ = USD.load("UsdShade").MaterialBindingAPI(prim).ComputeBoundMaterial()
        if not material:
            return ""
        look = self._materials.look(material)
        candidates = (
            label
            for label in _numbered(label_of(material.GetPrim()))
            if self._looks.setdefault(label, look) == look
        )
        return next(candidates)

    def look(self) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Return the materials of all labels so far, and the images that they use."""
        materials = [
            replace(look, name=label, double_sided=self._is_double_sided)
            for label, look in self._looks.items()
            if look is not None
        ]
        return select_materials([one.name for one in materials], materials, self._materials.images)


def label_of(prim: Any) -> str:
    """Return the display name of a prim, or else its name."""
    return str(prim.GetDisplayName() or prim.GetName())


def _numbered(name: str) -> Iterator[str]:
    """Yield the name, then the name with suffixes _2, _3 and so on."""
    yield name
    yield from (f"{name}_{number}" for number in count(2))


def read_groups(
    prim: Any, code: float, n_faces: int, materials: MeshMaterials, notes: list[str]
) -> tuple[FaceGroups, ...]:
    """Return the face groups of a mesh at a time code.

    Materials are those of subsets or, elsewhere, of the whole mesh. A label is the display name of
    the prim if it has one, otherwise its name.

    Parameters
    ----------
    prim : Usd.Prim
    materials : MeshMaterials
        Materials of the mesh, which provide labels.
    notes : list of str
        Gains a sentence for each family whose subsets overlap or refer to missing faces.
    """
    geometry = USD.load("UsdGeom")
    families: dict[str, list[tuple[str, Int32s]]] = {MATERIALS: []}
    for subset in geometry.Subset.GetAllGeomSubsets(geometry.Imageable(prim)):
        if subset.GetElementTypeAttr().Get() != geometry.Tokens.face:
            continue
        family = str(subset.GetFamilyNameAttr().Get() or UNNAMED)
        material = materials.bound_label(subset.GetPrim()) if family == MATERIALS else ""
        label = material or label_of(subset.GetPrim())
        faces = subset.GetIndicesAttr().Get(code)
        if not faces and subset.GetIndicesAttr().ValueMightBeTimeVarying():
            continue  # a label of other times
        members = families.setdefault(family, [])
        members.append((label, np.asarray([] if faces is None else faces, np.int32)))
    groups = []
    for family, members in families.items():
        name, default = (
            ("material", materials.bound_label(prim)) if family == MATERIALS else (family, "")
        )
        group, is_partition = _group(name, members, default, n_faces)
        if not is_partition:
            notes.append(
                f"{name} subsets of {prim.GetPath()} overlap or refer to missing faces; "
                "a face belongs to the last subset that contains it"
            )
        groups.append(group)
    return tuple(group for group in groups if group.labels)


def _group(
    name: str, members: list[tuple[str, Int32s]], default: str, n_faces: int
) -> tuple[FaceGroups, bool]:
    """Return a group, with `default` as label of the other faces, and whether subsets are disjoint
    and valid.
    """
    labels: dict[str, int] = {}
    numbers = np.full(n_faces, -1, np.int32)
    n_listed = 0
    for label, faces in members:
        inside = faces[(faces >= 0) & (faces < n_faces)]
        numbers[inside] = labels.setdefault(label, len(labels))
        n_listed += len(faces)
    is_partition = n_listed == np.count_nonzero(numbers >= 0)
    if default and (numbers < 0).any():
        numbers[numbers < 0] = labels.setdefault(default, len(labels))
    return FaceGroups(name, tuple(labels), numbers), is_partition
