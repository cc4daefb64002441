"""Contents of glTF files, from their JSON."""

import json
import struct
from collections.abc import Iterator
from itertools import compress
from operator import not_
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from contents.items import Item, Sort

EXTENSIONS = (".glb", ".gltf")

FIELDS = {
    "baseColorFactor": ("base_color", [1, 1, 1, 1]), "alphaMode": ("alpha_mode", "OPAQUE"),
    "metallicFactor": ("metallic", 1), "alphaCutoff": ("alpha_cutoff", 0.5),
    "roughnessFactor": ("roughness", 1), "emissiveFactor": ("emissive", [0, 0, 0]),
    "doubleSided": ("double_sided", False), "diffuseFactor": ("base_color", [1, 1, 1, 1]),
    "glossinessFactor": ("roughness", 0), "baseColorTexture": ("base_color_texture", None),
    "diffuseTexture": ("base_color_texture", None), "normalTexture": ("normal_texture", None),
    "occlusionTexture": ("occlusion_texture", None), "KHR_materials_unlit": ("unlit", None),
    "emissiveTexture": ("emissive_texture", None), "scale": ("normal_scale", 1),
    "metallicRoughnessTexture": ("metallic_texture", None), "strength": ("occlusion_strength", 1),
}  # fmt: skip
"""Fields of `Material` by key, and their defaults."""
GRAY = {
    "baseColorFactor": [0.456, 0.456, 0.456, 1.0],
    "metallicFactor": 0.0,
    "roughnessFactor": 0.4,
}
PLAIN = [
    {"pbrMetallicRoughness": look, "doubleSided": True} for look in ({"metallicFactor": 0.0}, GRAY)
]
"""Materials that writers give to faces without one, with colors and without."""
STORAGE = {
    "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression", "name",
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_node_visibility", "nodes", "mesh",
    "KHR_animation_pointer", "EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "skin",
    "MSFT_texture_dds", "children", "matrix", "translation", "rotation", "scale", "weights", "mode",
    "primitives", "joints", "inverseBindMatrices", "skeleton", "uri", "bufferView", "mimeType",
    "source", "sampler", "wrapS", "wrapT", "magFilter", "minFilter", "channels", "samplers",
    "version", "minVersion", "generator", "attributes", "targets", "indices", "material", "index",
    "texCoord", "emissiveStrength",
}  # fmt: skip
"""Keys of what other items are, or of how the file was written."""
CONTAINERS = {
    "extensions", "pbrMetallicRoughness", "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_emissive_strength", "normalTexture", "occlusionTexture",
}  # fmt: skip
SORTS = {"POSITION": Sort.POSITIONS, "TEXCOORD": Sort.UV, "COLOR": Sort.COLOR, "": Sort.DATA}
LISTS = ("scenes", "nodes", "meshes", "skins", "cameras", "images", "materials")

Json = dict[str, Any]


def walk(path: Path) -> Iterator[Item]:
    """Yield what a file holds: meshes at nodes of the scene, and all other objects."""
    data = path.read_bytes()
    if data[:4] == b"glTF":
        (size,) = struct.unpack_from("<I", data, 12)
        data = data[20 : 20 + size]
    gltf = json.loads(data.decode("utf-8-sig"))
    lists: dict[str, list[Json]] = {kind: gltf.get(kind, []) for kind in (*LISTS, "animations")}
    nodes, meshes, scene = lists["nodes"], lists["meshes"], gltf.get("scene", 0)
    above = {child: n for n, node in enumerate(nodes) for child in node.get("children", ())}
    roots = lists["scenes"][scene].get("nodes", []) if lists["scenes"] else range(len(nodes))
    with_mesh = [n for n, node in enumerate(nodes) if "mesh" in node and {*roots} & _up(n, above)]
    shown = [n for n in with_mesh if any(map(_is_read, meshes[nodes[n]["mesh"]]["primitives"]))]
    hidden = list[int]()
    is_hidden = [any(map(_is_hidden, (nodes[m] for m in _up(n, above)))) for n in shown]
    if not (all(is_hidden) or lists["animations"]):
        hidden = [*compress(shown, is_hidden)]
        yield from (Item(Sort.OTHER, _name(nodes, meshes, n)) for n in hidden)
        shown = [*compress(shown, map(not_, is_hidden))]
    skins = [lists["skins"][nodes[n]["skin"]] for n in shown if "skin" in nodes[n]]
    movers = {m for n in (*shown, *(j for s in skins for j in s["joints"])) for m in _up(n, above)}
    used = {nodes[n]["mesh"] for n in shown}
    primitives = [primitive for n in used for primitive in meshes[n]["primitives"]]
    materials = {primitive.get("material") for primitive in primitives if _is_read(primitive)}
    keep = {
        "scenes": {scene},
        "nodes": movers,
        "meshes": used | {nodes[n]["mesh"] for n in hidden},
        "materials": materials,
        "cameras": (),
    }
    for n in shown:
        if len(shown) > 1:
            yield Item(Sort.GROUP, _name(nodes, meshes, n), words=("parts",))
        for primitive in meshes[nodes[n]["mesh"]]["primitives"]:
            yield from _primitive(primitive, is_skinned="skin" in nodes[n])
    for kind in LISTS:
        for n, item in enumerate(lists[kind]):
            label = item.get("name") or f"{'mesh' if kind == 'meshes' else kind[:-1]} {n}"
            if n not in keep.get(kind, {n}):
                yield Item(Sort.OTHER, label)
            elif kind == "materials" and item not in PLAIN:
                if item.get("name"):
                    yield Item(Sort.GROUP, item["name"])
                earlier = [other.get("name", "") for other in lists[kind][:n]]
                name = item.get("name") or f"material_{n}"
                repeated = earlier.count(name)
                yield from _object(item, f"{name}_{repeated}" if repeated else name)
            elif kind == "images":
                file = unquote(str(item.get("uri", "-")))[:100]
                size = (
                    (path.parent / file).stat().st_size if (path.parent / file).is_file() else None
                )
                yield Item(
                    Sort.IMAGE,
                    label,
                    size,
                    (f"image {n}", file, "texture images", "appearance of materials"),
                )
            elif kind != "materials":
                own = {key: value for key, value in item.items() if key != "scale"}
                yield from _object(own, label)
    yield from _object({key: gltf[key] for key in ("extras", "extensions") if key in gltf}, "file")
    yield from _object(gltf["asset"], "asset")
    for n, animation in enumerate(lists["animations"]):
        name = animation.get("name") or f"animation_{n}"
        yield Item(Sort.TIMES if len(lists["animations"]) == 1 else Sort.OTHER, name)
        for channel in animation["channels"]:
            if (node := channel["target"].get("node", -1)) >= 0 and node not in movers:
                yield Item(
                    Sort.OTHER,
                    nodes[node].get("name") or f"node {node}",
                    words=(name,) if n else (),
                )


def _up(node: int, above: dict[int, int]) -> set[int]:
    found = {node}
    while node in above:
        found.add(node := above[node])
    return found


def _name(nodes: list[Json], meshes: list[Json], n: int) -> str:
    label = nodes[n].get("name") or meshes[nodes[n]["mesh"]].get("name") or f"node_{n}"
    return str(label).replace("/", "_")


def _is_hidden(node: Json) -> bool:
    return node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible") is False


def _is_read(primitive: Json) -> bool:
    return primitive.get("mode", 4) >= 4 and "POSITION" in primitive["attributes"]


def _primitive(primitive: Json, *, is_skinned: bool) -> Iterator[Item]:
    if not _is_read(primitive):
        is_line = primitive.get("mode", 4) < 4
        yield Item(Sort.OTHER, "points and lines" if is_line else "primitives without positions")
        return
    yield Item(Sort.FACES, "faces")
    for name in [*primitive["attributes"], *(n for t in primitive.get("targets", ()) for n in t)]:
        if name == "NORMAL":
            yield Item(Sort.EDGES, "normals", words=("hard edge", "hard edges"))
        elif not (is_skinned and name[:6] in ("JOINTS", "WEIGHT")):
            nouns = ("tangents", "joints", "weights")
            yield Item(SORTS.get(name.partition("_")[0], Sort.OTHER), name, words=nouns)
    yield from _object(primitive, "primitive")


def is_labels(value: Any) -> bool:
    """Return whether extras are marks of our writer, or labels of morph targets."""
    keys = value.keys() if isinstance(value, dict) else {""}
    return all(key == "targetNames" or key.startswith("meshreel") for key in keys)


def _object(item: Json, label: str, *words: str) -> Iterator[Item]:
    """Yield the properties of a material, and extras, extensions and other keys of any object."""
    for key, value in item.items():
        field, default = FIELDS.get(key, ("", value))
        nouns = ("appearance of materials", "specular-glossiness", "texture images", label)
        if value != default:
            yield Item(Sort.MATERIAL, f"{label}.{field}", words=nouns)
        if key == "metallicRoughnessTexture":
            yield Item(Sort.MATERIAL, f"{label}.roughness_texture", words=nouns)
        if key in CONTAINERS and isinstance(value, dict):
            yield from _object(value, label, key)
        elif key in ("camera", "KHR_lights_punctual"):
            yield Item(Sort.OTHER, label, words=("cameras", "lights"))
        elif key not in STORAGE and not field and not (key == "extras" and is_labels(value)):
            yield Item(Sort.OTHER, key, words=words)
