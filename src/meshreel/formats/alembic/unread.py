"""Notes on everything in an Alembic file that was not read."""

from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter

from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import AbcObject, Property
from meshreel.formats.alembic.attributes import INDICES, PARAMS, USER, VALUES, GeometryParam
from meshreel.model.notes import Notes

BOOKKEEPING = {
    ".selfBnds": "bounds, which programs compute",
    ".childBnds": "likewise",
    ".animChans": "which channels of a transform change",
    "isNotConstantIdentity": "whether a transform moves anything",
    ".facesExclusive": "whether face sets overlap",
    "samples": "number of samples of a time sampling",
    "statistics": "number of objects",
}
"""Properties without content of their own, and why."""

MISFITS = "properties that do not fit the faces"
"""Subject of the note on values whose number fits no domain of a mesh."""

Properties = Mapping[str, Property]


def note_unread(objects: Sequence[AbcObject], notes: Notes) -> None:
    """Note the properties of objects that were not read, or do not fit the mesh."""
    unread: list[tuple[str, str]] = []
    for item in objects:
        try:
            for path, values in _leaves(item.properties):
                if path[-1].rpartition("samples")[1] or not BOOKKEEPING.keys().isdisjoint(path):
                    continue
                if values not in item.archive.read or values in item.archive.unfit:
                    name = next(part for part in reversed(path) if part not in (VALUES, INDICES))
                    unread.append((_subject(path, values), name.lstrip(".")))
        except FormatError as error:
            unread.append(("properties that cannot be read", f"{item.name} ({error})"))
    notes.left_out_items(sorted(unread, key=itemgetter(0)))


def _leaves(
    properties: Properties, above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], Property]]:
    """Yield the properties with values, and the names of the compounds above and their own."""
    for name, item in properties.items():
        if item.is_compound:
            yield from _leaves(item.properties, (*above, name))
        elif not item.is_empty:
            yield (*above, name), item


def _subject(path: tuple[str, ...], values: Property) -> str:
    if USER in path:
        return "user properties"
    if values in values.archive.unfit:
        return "text that is not constant for each face" if values.is_text else MISFITS
    if PARAMS in path and GeometryParam(values).domain is None:
        return "values for a whole mesh"
    return "other properties"
