"""What a file cannot hold of a surface, in words."""

from collections.abc import Collection

from meshreel.formats.notes import listed
from meshreel.surface import Attribute, FaceGroups, Surface


def note_unwritten(
    surface: Surface,
    written: Collection[Attribute | FaceGroups | None],
    ending: str,
    notes: list[str] | None,
    *,
    parts: bool = False,
    polygons: bool = True,
) -> None:
    """Add a sentence to the notes, if there are any, on what is left out of a file.

    Parameters
    ----------
    surface : Surface
    written : collection of Attribute, FaceGroups or None
        Those of the surface that the file holds.
    ending : str
        Of the file, with the dot.
    notes : list of str or None
    parts, polygons : bool
        Whether the file holds the parts, and faces of more than three corners.
    """
    everything: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    missing = [_named(one) for one in everything if not any(one is held for held in written)]
    if surface.parts and not parts:
        missing.append(f"the names of {len(surface.parts)} parts")
    if surface.face_sizes is not None and not polygons:
        missing.append("faces of more than three corners, which are cut into triangles")
    if missing and notes is not None:
        notes.append(f"left out, for {ending} files do not hold it: {', '.join(missing)}")


def note_unwritten_look(surface: Surface, ending: str, notes: list[str]) -> None:
    """Add a sentence to the notes if a surface has materials or images, which a file cannot hold.

    Parameters
    ----------
    surface : Surface
    ending : str
        Of the file, with the dot.
    notes : list of str
    """
    missing = []
    if surface.materials:
        missing.append(f"how materials look ({listed(one.name for one in surface.materials)})")
    if n_images := len(surface.images):
        missing.append(f"{n_images} texture image{'s' if n_images > 1 else ''}")
    if missing:
        notes.append(f"left out, for {ending} files do not hold it: {' and '.join(missing)}")


def _named(one: Attribute | FaceGroups) -> str:
    if isinstance(one, FaceGroups):
        return f"groups {one.name!r}"
    return f"{one.name!r} ({one.kind}) of each {one.domain}"
