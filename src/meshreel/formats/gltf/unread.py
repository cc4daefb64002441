"""Notes on everything that a glTF file holds and the reader did not read."""

from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from typing import Any

from meshreel.formats.gltf.container import Json
from meshreel.formats.gltf.document import LISTS, ROOT, Document, JsonObject
from meshreel.formats.gltf.scene import Nodes, ShownMesh
from meshreel.model.notes import NORMALS, Notes, listed

BOOKKEEPING = {
    "name": "labels",
    "generator": "the program that wrote the file",
    "extensionsUsed": "named where they are used",
    "skeleton": "a hint for tools",
    "alphaCutoff": "read where it has an effect",
    "accessors": "numbers, which belong to what refers to them",
    "buffers": "likewise",
    "bufferViews": "likewise",
    "samplers": "likewise",
    "textures": "likewise",
    "animations": "noted when one is selected",
    "scene": "read if it matters",
}
"""Keys without content of their own, and why."""

TARGET_NAMES = "targetNames"
"""Key of extras with labels of morph targets, which become positions."""

EXCLUDED = LISTS.keys() | BOOKKEEPING.keys()
"""Keys that are not named: items of the lists are, where meshes refer to them."""

NOUNS = {
    "camera": "cameras",
    "KHR_lights_punctual": "lights",
    "NORMAL": NORMALS,
    "TANGENT": "tangents, which programs compute",
    "EXT_mesh_gpu_instancing": "copies of a mesh (EXT_mesh_gpu_instancing), which is read once",
}
"""Subjects of notes on keys; others are the subject themselves."""

Items = dict[str, set[int]]
"""Numbers of items by the list of the file."""

Unread = list[tuple[str, str]]
"""The subject of the note and the name of each thing that was not read."""


def used_items(document: Document, nodes: Nodes, meshes: Iterable[ShownMesh]) -> Items:
    """Return the items to which meshes refer, and those to which these refer."""
    used: Items = {kind: set() for kind in document.lists}
    meshes = list(meshes)
    carriers = (node for mesh in meshes for node in (mesh.node, *mesh.carriers))
    used["nodes"].update(nodes.with_ancestors([*carriers]))
    for mesh in meshes:
        own = nodes.objects[mesh.node].values
        used["meshes"].add(own["mesh"])
        used["skins"].update({own["skin"]} if mesh.skin is not None else ())
        primitives = [primitive.json.values for primitive in mesh.mesh.triangles]
        used["materials"].update(_integers(primitives, "material"))
    used["materials"].intersection_update(range(len(document.lists["materials"])))
    for kind, key, parents in (
        ("textures", "index", "materials"),
        ("images", "source", "textures"),
        ("samplers", "sampler", "textures"),
    ):
        for number in used[parents]:
            indices = _integers(document.lists[parents][number].values, key)
            used[kind].update(index for index in indices if index < len(document.lists[kind]))
    return used


def _integers(value: Any, key: str) -> Iterator[int]:
    """Yield the nonnegative integers with a key anywhere in JSON values."""
    values = [value]
    while values:
        value = values.pop()
        if isinstance(value, dict):
            number = value.get(key)
            if isinstance(number, int) and number >= 0:
                yield number
            values += value.values()
        elif isinstance(value, list):
            values += value


def note_other_items(
    document: Document, nodes: Nodes, meshes: Sequence[ShownMesh], notes: Notes
) -> None:
    """Note what belongs to no mesh: cameras, nodes, materials, and properties of the file."""
    used = used_items(document, nodes, meshes)
    scene = document.root.get("scene", 0)
    used["scenes"] = {scene} if isinstance(scene, int) else set()
    unread: Unread = []
    for kind in LISTS.keys() - BOOKKEEPING.keys():
        for number, item in enumerate(document.lists[kind]):
            if number not in used[kind]:
                keys = NOUNS.keys() & {*item.values, *_extensions(item.values)}
                subject = NOUNS[min(keys)] if keys else f"other {kind}"
                unread.append((subject, _label(item.values, item.place)))
    unread += _unread_keys([document.root, *document.lists["scenes"]])
    notes.left_out_items(sorted(unread, key=itemgetter(0)))


def note_unread(
    document: Document, nodes: Nodes, meshes: Sequence[ShownMesh], notes: Notes
) -> None:
    """Note what was not read of the meshes that were read, and of the items they refer to."""
    used = used_items(document, nodes, filter(_has_been_read, meshes))
    unread: Unread = []
    for kind in used.keys() - BOOKKEEPING.keys():
        items = [document.lists[kind][number] for number in sorted(used[kind])]
        labels = (_label(item.values, item.place) for item in items if not _is_read(item))
        unread += ((f"other {kind}", label) for label in labels)
        unread += _unread_keys(filter(_is_read, items))
    notes.left_out_items(sorted(unread, key=itemgetter(0)))


def _unread_keys(items: Iterable[JsonObject]) -> Iterator[tuple[str, str]]:
    """Yield the subjects of the keys of items that were not read, with the labels of the items."""
    for item in items:
        label = _label(item.values, item.place)
        for key, value in _unread(item.values, item.read_keys):
            for name in _extensions({key: value}) or [key]:
                labels = [label]
                if name == "extras" and isinstance(value, dict):
                    extras = [name for name in value if name != TARGET_NAMES]
                    labels = [f"{label} ({listed(extras)})"] if extras else []
                elif item.place == ROOT and isinstance(value, list):
                    noun = name.removesuffix("s")
                    labels = [_label(entry, f"{noun} {n}") for n, entry in enumerate(value)]
                yield from ((NOUNS.get(name, name), text) for text in labels)


def _has_been_read(mesh: ShownMesh) -> bool:
    attributes = (primitive.attributes for primitive in mesh.mesh.triangles)
    return any((id(names.values), "POSITION") in names.read_keys for names in attributes)


def _is_read(item: JsonObject) -> bool:
    """Return whether any key of an object was read, or there is none."""
    keys = ((id(item.values), key) for key in item.values)
    return not item.values or any(key in item.read_keys for key in keys)


def _unread(values: Json, read_keys: set[tuple[int, str]]) -> Iterator[tuple[str, Any]]:
    """Yield keys that were not read, and their values, of an object and those within."""
    for key, value in values.items():
        if key in EXCLUDED:
            continue
        if (id(values), key) not in read_keys:
            yield key, value
            continue
        for inner in value if isinstance(value, list) else [value]:
            if isinstance(inner, dict):
                yield from _unread(inner, read_keys)


def _extensions(values: Json) -> Json:
    extensions = values.get("extensions")
    return extensions if isinstance(extensions, dict) else {}


def _label(values: Any, place: str) -> str:
    name = values.get("name") if isinstance(values, dict) else None
    return name if name and isinstance(name, str) else place
