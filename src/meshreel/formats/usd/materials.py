"""Reading materials of a stage: UsdPreviewSurface with its textures, and face subsets as groups."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, count
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.file_errors import check_input_file
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.surfaces.images import image_type
from meshreel.formats.usd.stage import outer_file
from meshreel.formats.usd.unread import StageContents
from meshreel.model.materials import AlphaMode, Image, Material, Texture, Wrap, select_materials
from meshreel.model.notes import CHANGES, Notes
from meshreel.model.surface import FaceGroups, Int32s
from meshreel.runtime.extras import USD

Numbers = tuple[float, ...]

MATERIALS = "materialBind"
"""The subset family for material bindings."""

UNNAMED = "group"
"""Name of the group of subsets without a family."""

WRAPS = {
    "repeat": Wrap.REPEAT,
    "mirror": Wrap.MIRROR,
    "clamp": Wrap.CLAMP,
    "black": Wrap.BLACK,
    "useMetadata": Wrap.METADATA,
}
UV_READER = "UsdPrimvarReader_float2"
CHANNELS = ("rgb", "r", "g", "b", "a")

INPUTS: dict[str, tuple[str, Numbers]] = {
    "base_color": ("diffuseColor", (0.18, 0.18, 0.18)),
    "metallic": ("metallic", (0.0,)),
    "roughness": ("roughness", (0.5,)),
    "normal": ("normal", (0.0, 0.0, 1.0)),
    "occlusion": ("occlusion", (1.0,)),
    "emissive": ("emissiveColor", (0.0, 0.0, 0.0)),
}
"""Shader inputs that may have textures, and their defaults, by texture slot."""

NO_SCALE, NO_BIAS = (1.0,) * 4, (0.0,) * 4


class StageMaterials:
    """The materials and images of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Folder of the stage's file, which must contain the images; None allows any location.
    contents : StageContents
        Records what is read.

    Attributes
    ----------
    images : list of Image
        The images read so far, to which materials refer.
    """

    def __init__(self, folder: Path | None, contents: StageContents) -> None:
        self.images: list[Image] = []
        self._folder = None if folder is None else folder.resolve()
        self.contents: StageContents = contents
        self.notes: Notes = contents.notes
        self._indices: dict[str, int] = {}
        self._looks: dict[str, Material | None] = {}

    def look(self, material: Any) -> Material | None:
        """Return the appearance of a ``UsdShade.Material``, unnamed, or None if not readable.

        Materials of instances share one result.
        """
        path = str(material.GetPath())
        if path not in self._looks:
            self._looks[path] = self._read(material)
        return self._looks[path]

    def bound_to(self, mesh: Any) -> list[Any]:
        """Return the prims of the materials of a mesh and its subsets."""
        api = USD.load("UsdShade").MaterialBindingAPI
        owners = [mesh, *(subset.GetPrim() for subset in api(mesh).GetMaterialBindSubsets())]
        return [found.GetPrim() for found in api.ComputeBoundMaterials(owners)[0] if found]

    def source(self, shader: Any, name: str) -> "Source":
        """Return the source of a shader input, through the interface inputs of materials."""
        shading, usd = USD.load("UsdShade"), USD.load("Usd")
        shader_input = shader.GetInput(name)
        attribute = shader_input.GetAttr() if shader_input else None
        while attribute and not self.contents.has(attribute):
            self.contents.add(attribute.GetPrim(), attribute.GetName())
            targets = attribute.GetConnections()
            attribute = self.contents.stage.GetAttributeAtPath(targets[0]) if targets else None
        producers = shader_input.GetValueProducingAttributes() if shader_input else []
        if not producers:
            return Source()
        producer = producers[0]
        if shading.Utils.GetType(producer.GetName()) == shading.AttributeType.Output:
            output = shading.Utils.GetBaseNameAndType(producer.GetName())[0]
            return Source(None, shading.Shader(producer.GetPrim()), str(output))
        return Source(producer.Get(usd.TimeCode.EarliestTime()))

    def image_index(self, asset: Any) -> int:
        """Return the index of an asset path in `images`, after reading it if necessary.

        Raises
        ------
        FormatError
            If the image cannot be read.
        """
        authored = str(getattr(asset, "path", ""))
        resolved = str(getattr(asset, "resolvedPath", ""))
        if not authored:
            raise FormatError("it names no file")
        if not resolved:
            reason = "consists of many tiles" if "<UDIM>" in authored else "does not exist"
            raise FormatError(f"{authored[:200]!r} {reason}")
        if resolved not in self._indices:
            self.images.append(self._image(authored, resolved))
            self._indices[resolved] = len(self.images) - 1
        return self._indices[resolved]

    def _image(self, authored: str, resolved: str) -> Image:
        resolver, file = USD.load("Ar"), outer_file(resolved)
        if self._folder and not is_within(file, self._folder):
            raise outside_error(authored)
        if not file.is_file():
            raise FormatError(f"{authored[:200]!r} is not a file")
        check_input_file(file)
        asset = resolver.GetResolver().OpenAsset(resolver.ResolvedPath(resolved))
        if not asset:
            raise FormatError(f"{authored[:200]!r} cannot be read")
        data, name = bytes(asset.GetBuffer()), PurePosixPath(authored.rstrip("]"))
        return Image(name.stem, image_type(data, name.name), data)

    def _read(self, material: Any) -> Material | None:
        name = label_of(material.GetPrim())
        self.contents.add(material.GetPrim())
        shader, _, _ = material.ComputeSurfaceSource()
        if _shader_id(shader) != "UsdPreviewSurface":
            if any(output.HasConnectedSource() for output in material.GetOutputs()):
                self.notes.left_out("appearance of materials without UsdPreviewSurface", [name])
            return None
        self.contents.add(shader.GetPrim())
        return _PreviewSurface(shader, name, self).material()


def read_materials(
    prim: Any, code: float, n_faces: int, stage: StageMaterials
) -> tuple[tuple[FaceGroups, ...], tuple[Material, ...], tuple[Image, ...]]:
    """Return the face groups of a mesh at a time code, and the materials of their labels.

    Materials are those of subsets or, elsewhere, of the whole mesh. A label is the display name of
    the prim if it has one, otherwise its name; materials with the same name but different
    appearance get different labels. Notes name families whose subsets overlap or refer to missing
    faces.
    """
    geometry = USD.load("UsdGeom")
    looks: dict[str, Material | None] = {}

    def bound_label(bound_prim: Any) -> str:
        """Return the label of the material bound to a prim; empty if there is none."""
        material, _ = USD.load("UsdShade").MaterialBindingAPI(bound_prim).ComputeBoundMaterial()
        if not material:
            return ""
        look, name = stage.look(material), label_of(material.GetPrim())
        labels = chain([name], (f"{name}_{number}" for number in count(2)))
        return next(label for label in labels if looks.setdefault(label, look) == look)

    families: dict[str, list[tuple[str, Int32s]]] = {MATERIALS: []}
    for subset in geometry.Subset.GetAllGeomSubsets(geometry.Imageable(prim)):
        if subset.GetElementTypeAttr().Get() != geometry.Tokens.face:
            continue
        stage.contents.add(subset.GetPrim(), "elementType", "familyName", "indices")
        family = str(subset.GetFamilyNameAttr().Get() or UNNAMED)
        material = bound_label(subset.GetPrim()) if family == MATERIALS else ""
        faces, changes = (
            subset.GetIndicesAttr().Get(code),
            subset.GetIndicesAttr().ValueMightBeTimeVarying(),
        )
        if changes and not prim.GetAttribute("faceVertexCounts").ValueMightBeTimeVarying():
            stage.notes.left_out(CHANGES, [str(subset.GetPath())])
        if changes and not faces:
            continue  # a label of other times
        members = families.setdefault(family, [])
        label = material or label_of(subset.GetPrim())
        members.append((label, np.asarray([] if faces is None else faces, np.int32)))
    groups = []
    for family, members in families.items():
        is_material = family == MATERIALS
        name = "material" if is_material else family
        default = bound_label(prim) if is_material else ""
        group, is_partition = _group(name, members, default, n_faces)
        groups += [group] if group.labels else []
        if not is_partition:
            stage.notes.changed(
                f"{name} subsets of {prim.GetPath()} overlap or refer to missing faces; "
                "a face belongs to the last subset that contains it"
            )
    is_double_sided = bool(geometry.Gprim(prim).GetDoubleSidedAttr().Get())
    if any(looks.values()):
        stage.contents.add(prim, "doubleSided")
    materials = [
        replace(look, name=label, double_sided=is_double_sided)
        for label, look in looks.items()
        if look is not None
    ]
    names = [material.name for material in materials]
    return tuple(groups), *select_materials(names, materials, stage.images)


def label_of(prim: Any) -> str:
    """Return the display name of a prim, or else its name."""
    return str(prim.GetDisplayName() or prim.GetName())


def _group(
    name: str, members: Sequence[tuple[str, Int32s]], default: str, n_faces: int
) -> tuple[FaceGroups, bool]:
    """Return a group, with `default` as label of the other faces, and whether subsets are disjoint
    and valid.
    """
    labels: dict[str, int] = {}
    numbers = np.full(n_faces, -1, np.int32)
    for label, faces in members:
        valid_faces = faces[(faces >= 0) & (faces < n_faces)]
        numbers[valid_faces] = labels.setdefault(label, len(labels))
    is_partition = sum(len(faces) for _, faces in members) == np.count_nonzero(numbers >= 0)
    if default and (numbers < 0).any():
        numbers[numbers < 0] = labels.setdefault(default, len(labels))
    return FaceGroups(name, tuple(labels), numbers), is_partition


class Source(NamedTuple):
    """The value of a shader input, or the shader and the output connected to it."""

    value: Any = None
    shader: Any = None
    output: str = ""


def read_numbers(source: Source, default: Numbers, name: str) -> Numbers:
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
        numbers = tuple(float(number) for number in (value if len(default) > 1 else [value]))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(default) or not all(map(math.isfinite, numbers)):
        raise FormatError(f"{name} must be {len(default)} finite numbers; got {str(value)[:60]!r}")
    return numbers


def _shader_id(shader: Any) -> str:
    return str(shader.GetShaderId() or "") if shader else ""


@dataclass(frozen=True)
class ScaledTexture:
    """A texture with scale and bias of its values, of four numbers each."""

    texture: Texture
    scale: Numbers
    bias: Numbers
    color_space: str


def read_texture(source: Source, materials: StageMaterials) -> ScaledTexture:
    """Return the texture connected to an input of a material.

    Raises
    ------
    FormatError
        If the source is not a texture, or its image cannot be read.
    """
    shader, kind = source.shader, _shader_id(source.shader)
    if kind != "UsdUVTexture" or source.output not in CHANNELS:
        raise FormatError(f"{kind or 'a shader of unknown type'} is not supported")
    wrap_u, wrap_v = (_wrap(shader, name, materials) for name in ("wrapS", "wrapT"))
    texture = Texture(0, "", source.output, wrap_u, wrap_v)
    texture = _with_coordinates(texture, materials.source(shader, "st").shader, materials)
    return ScaledTexture(
        replace(texture, image=materials.image_index(materials.source(shader, "file").value)),
        read_numbers(materials.source(shader, "scale"), NO_SCALE, "its scale"),
        read_numbers(materials.source(shader, "bias"), NO_BIAS, "its bias"),
        str(materials.source(shader, "sourceColorSpace").value or "auto"),
    )


def _wrap(shader: Any, name: str, materials: StageMaterials) -> Wrap:
    wrap = str(materials.source(shader, name).value or "useMetadata")
    if wrap not in WRAPS:
        raise FormatError(f"{name} is {wrap[:60]!r}; it must be one of {', '.join(WRAPS)}")
    return WRAPS[wrap]


def _with_coordinates(texture: Texture, shader: Any, materials: StageMaterials) -> Texture:
    """Return the texture with its primvar and transform, from the shader of its coordinates."""
    if _shader_id(shader) == "UsdTransform2d":
        defaults: dict[str, Numbers] = {
            "rotation": (0.0,), "scale": (1.0, 1.0), "translation": (0.0, 0.0),
        }  # fmt: skip
        (angle,), (scale_u, scale_v), (shift_u, shift_v) = (
            read_numbers(materials.source(shader, name), default, f"its {name}")
            for name, default in defaults.items()
        )
        shader, rotation = materials.source(shader, "in").shader, math.radians(angle)
        offset = (  # v points up in USD
            shift_u - math.sin(rotation) * scale_v,
            1 - shift_v - math.cos(rotation) * scale_v,
        )
        texture = replace(texture, offset=offset, rotation=rotation, scale=(scale_u, scale_v))
    if (kind := _shader_id(shader)) != UV_READER:
        raise FormatError(f"its coordinates come from {kind or 'no shader'}, not {UV_READER}")
    name = str(materials.source(shader, "varname").value or "")
    if not name:
        raise FormatError(f"its {UV_READER} has no primvar name")
    return replace(texture, uv=name)


class _PreviewSurface:
    """The appearance of a material, as defined by a UsdPreviewSurface shader.

    Parameters
    ----------
    name : str
        Name of the material, for the notes.
    materials : StageMaterials
        Owner of the images, whose notes gain unsupported properties.
    """

    def __init__(self, shader: Any, name: str, materials: StageMaterials) -> None:
        self._name, self._materials = name, materials
        self._source = partial(materials.source, shader)
        self._sources = {slot: self._source(name) for slot, (name, _) in INPUTS.items()}
        self._textures: dict[str, ScaledTexture] = {}
        for slot, source in self._sources.items():
            if source.shader:
                self._read_texture(slot, source)

    def material(self) -> Material:
        """Return the material, unnamed."""
        opacity = self._source("opacity")
        (threshold,) = self._numbers("opacityThreshold", self._source("opacityThreshold"), (0.0,))
        textures = {slot: texture.texture for slot, texture in self._textures.items()}
        if has_alpha := self._is_alpha_of_color(opacity):
            textures["base_color"] = replace(textures["base_color"], channels="rgba")
            alpha = self._textures["base_color"].scale[3]
        red, green, blue = self._factor("base_color")
        if not has_alpha:
            (alpha,) = self._numbers("opacity", opacity, (1.0,))
        (metallic,), (roughness,) = self._factor("metallic"), self._factor("roughness")
        emissive = self._factor("emissive")
        mode = AlphaMode.BLEND if has_alpha or alpha < 1 else AlphaMode.OPAQUE
        return Material(
            "",
            base_color=(red, green, blue, alpha),
            metallic=metallic,
            roughness=roughness,
            emissive=(emissive[0], emissive[1], emissive[2]),
            normal_scale=self._strength("normal"),
            occlusion_strength=self._strength("occlusion"),
            alpha_mode=AlphaMode.MASK if threshold > 0 else mode,
            alpha_cutoff=threshold if threshold > 0 else 0.5,
        ).with_textures(textures)

    def _read_texture(self, slot: str, source: Source) -> None:
        name, default = INPUTS[slot]
        try:
            texture = read_texture(source, self._materials)
            if (texture.texture.channels == "rgb") != (len(default) == 3):
                raise FormatError(f"it has the channels {texture.texture.channels}")
        except FormatError as error:
            self._note(f"the texture of {name} ({error})")
            return
        expected = "sRGB" if slot in ("base_color", "emissive") else "raw"
        if texture.color_space not in ("auto", expected):
            self._note(f"color space {texture.color_space[:60]!r} of the texture of {name}")
        if slot not in ("normal", "occlusion") and texture.bias != NO_BIAS:
            self._note(f"bias of the texture of {name}")
        self._textures[slot] = texture

    def _numbers(self, name: str, source: Source, default: Numbers) -> Numbers:
        try:
            return read_numbers(source, default, name)
        except FormatError as error:
            self._note(f"invalid inputs ({error})")
            return default

    def _factor(self, slot: str) -> Numbers:
        """Return the factor on the texture, or the value if there is no texture."""
        name, default = INPUTS[slot]
        if slot not in self._textures:
            return self._numbers(name, self._sources[slot], default)
        scale, channels = self._textures[slot].scale, self._textures[slot].texture.channels
        return tuple(scale["rgba".index(channel)] for channel in channels)

    def _is_alpha_of_color(self, opacity: Source) -> bool:
        if not opacity.shader:
            return False
        color = self._sources["base_color"].shader
        is_same = bool(color) and opacity.shader.GetPath() == color.GetPath()
        if is_same and opacity.output == "a" and "base_color" in self._textures:
            return True
        self._note("opacity that is not the alpha of the color texture")
        return False

    def _strength(self, slot: str) -> float:
        """Return the scale of normals, or the strength of occlusion."""
        name, default = INPUTS[slot]
        texture = self._textures.get(slot)
        if texture is None:
            if self._numbers(name, self._sources[slot], default) != default:
                self._note(f"constant {slot}")
            return 1.0
        scale, bias = texture.scale, texture.bias
        if slot == "normal":
            # Normal maps store -1..1 as 0..1, even if scale and bias are missing.
            if (scale, bias) == (NO_SCALE, NO_BIAS):
                return 1.0
            strength, numbers = scale[0] / 2, scale[:3] + bias[:3]
            expected: Numbers = (2 * strength, 2 * strength, 2.0, -strength, -strength, -1.0)
        else:
            channel = "rgba".index(texture.texture.channels)
            strength, numbers, expected = scale[channel], (bias[channel],), (1 - scale[channel],)
        if not np.allclose(numbers, expected, atol=1e-6):
            self._note(f"scale and bias of the texture of {slot}")
            return 1.0
        return strength

    def _note(self, subject: str) -> None:
        self._materials.notes.left_out(subject, [self._name])
