"""Sentences on what is left out of an input or an output, in the same words for every format."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from meshreel.model.surface import Attribute, FaceGroups, Surface
from meshreel.runtime.counting import counted

LEFT_OUT = "left out: "
"""How a note begins that names something of the input that is in no output."""


NORMALS_LEFT_OUT = f"{LEFT_OUT}normals, which programs compute"
"""The note on stored normals."""

NORMALS_FAR = "normals do not follow from the faces at "
"""How the note on normals begins that are not near those computed."""

ASSUMED_FPS = 24
"""What players of this project show per second where a stream has no frame rate."""

UNCHANGING = "what is no track, for it is not seen to change"
"""A kind of things that are left out: velocities and the like of one frame."""


def note_left_out(notes: list[str], what: str) -> None:
    """Add to the notes that something is left out, unless they say so already.

    Parameters
    ----------
    what : str
        The thing, and which, as in "fields that change over time: pressure, velocity".
    """
    note = f"{LEFT_OUT}{what}"
    if note not in notes:
        notes.append(note)


def listed(names: Iterable[str], most: int = 8) -> str:
    """The names in one line, the first of them if there are many: "a, b and 3 more"."""
    found = list(names)
    rest = f" and {len(found) - most} more" if len(found) > most else ""
    return ", ".join(found[:most]) + rest


def note_moving(notes: list[str], names: Iterable[str]) -> None:
    """Add to the notes that fields are left out because they change over time."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"fields that change over time: {listed(found)}")


def note_frozen(notes: list[str], names: Iterable[str]) -> None:
    """Add to the notes that attributes stay as they are in the first frame."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"changes over time of {listed(found)}, kept as in the first frame")


def note_unknown_rate(notes: list[str], n_frames: int, fps: float) -> None:
    """Add to the notes that an animation has no frame rate; nothing if it has one."""
    if n_frames > 1 and not fps:
        notes.append(
            "the frame rate is unknown, and stored as unknown: players assume "
            f"{ASSUMED_FPS} frames per second; set it with --fps (fps=)"
        )


def note_kinds(notes: list[str], kind: str, names: Iterable[str]) -> None:
    """Add to the notes that things of a kind are left out: "curves: /a, /b"; nothing for none."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"{kind}: {listed(found)}")


def note_normals(notes: list[str]) -> None:
    """Add to the notes that stored normals are left out."""
    note_left_out(notes, NORMALS_LEFT_OUT.removeprefix(LEFT_OUT))


def describe_cages(names: Sequence[str]) -> str:
    """The sentence on subdivision surfaces, of which the cage is read: for a `GatheredNote`."""
    cages = "whose cage is read" if len(names) == 1 else "whose cages are read"
    return f"{LEFT_OUT}subdivision of {listed(names)}, {cages}"


class GatheredNote:
    """A sentence in the notes that grows with each thing that is named to it.

    Parameters
    ----------
    notes : list of str
        Gains the sentence, which changes later.
    sentence : function of the names, at least one
        Gives it; `listed` shortens many.
    """

    def __init__(self, notes: list[str], sentence: Callable[[Sequence[str]], str]) -> None:
        self._notes, self._sentence = notes, sentence
        self._names: list[str] = []

    def add(self, name: str) -> None:
        """Tell of one more thing; of one that it knows, nothing changes."""
        if name in self._names:
            return
        if self._names and (said := self._sentence(self._names)) in self._notes:
            self._notes.remove(said)
        self._names.append(name)
        self._notes.append(self._sentence(self._names))


class LookNotes:
    """Sentences that grow as materials are read one after the other.

    Parameters
    ----------
    notes : list of str
        Gains the sentences, which change later.
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Tell that something of a material is left out."""
        names = self._names.setdefault(what, {})
        if name in names:
            return
        before = self._sentence(what)
        names[name] = None
        if before in self._notes:
            self._notes[self._notes.index(before)] = self._sentence(what)
        else:
            self._notes.append(self._sentence(what))

    def _sentence(self, what: str) -> str:
        return f"{LEFT_OUT}{what}: {listed(self._names[what])}"


def note_unwritten(
    surface: Surface,
    written: Collection[Attribute | FaceGroups | None],
    ending: str,
    notes: list[str] | None,
    *,
    parts: bool = False,
    polygons: bool = True,
    hard_edges: bool = False,
) -> None:
    """Add a sentence to the notes, if there are any, on what is left out of a file.

    Parameters
    ----------
    written : collection of Attribute, FaceGroups or None
        Those of the surface that the file holds.
    ending : str
        Of the file, with the dot.
    parts, polygons, hard_edges : bool
        Whether the file holds the parts, faces of more than three corners, and hard edges.
    """
    everything: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    missing = [_named(one) for one in everything if not any(one is held for held in written)]
    if surface.parts and not parts:
        missing.append(f"the names of {len(surface.parts)} parts")
    if surface.face_sizes is not None and not polygons:
        missing.append("faces of more than three corners, which are cut into triangles")
    if surface.hard_edges is not None and not hard_edges:
        missing.append(counted(len(surface.hard_edges), "hard edge"))
    if missing and notes is not None:
        notes.append(f"left out, for {ending} files do not hold it: {', '.join(missing)}")


def note_unwritten_look(surface: Surface, ending: str, notes: list[str]) -> None:
    """Add a sentence to the notes if a surface has materials or images, which a file cannot hold.

    Parameters
    ----------
    ending : str
        Of the file, with the dot.
    """
    missing = []
    if surface.materials:
        missing.append(f"how materials look ({listed(one.name for one in surface.materials)})")
    if n_images := len(surface.images):
        missing.append(f"{n_images} texture image{'s' if n_images > 1 else ''}")
    if missing:
        notes.append(f"left out, for {ending} files do not hold it: {' and '.join(missing)}")


def note_unwritten_tracks(
    names: Iterable[str], ending: str, notes: list[str], which: str = "them"
) -> None:
    """Add a sentence to the notes on tracks that a file does not hold; nothing for none.

    Parameters
    ----------
    names : iterable of str
    ending : str
        Of the file, with the dot.
    which : str
        What it does not hold, such as "tracks of corners".
    """
    if found := list(names):
        notes.append(f"tracks left out: {listed(found)}: {ending} does not hold {which}")


def note_track_name(name: str, called: str, ending: str, notes: list[str]) -> None:
    """Add to the notes, once, that a track has another name in a file; nothing if it has not."""
    note_name("track", name, called, ending, notes)


def note_name(what: str, name: str, called: str, ending: str, notes: list[str]) -> None:
    """Add to the notes, once, that something has another name in a file; nothing if it has not.

    Parameters
    ----------
    what : str
        The kind of thing, such as "track" or "material".
    name, called : str
        Its name, and that in the file.
    ending : str
        Of the file, with the dot.
    """
    note = f"{what} {name!r} is called {called!r} in {ending} files"
    if name != called and note not in notes:
        notes.append(note)


def note_track_type(name: str, given: object, written: object, notes: list[str]) -> None:
    """Add to the notes, once, that numbers of a track change their type; nothing if they do not."""
    note = f"track {name!r} is written as {written}, not {given}"
    if given != written and note not in notes:
        notes.append(note)


def note_unwritten_units(units: Mapping[str, str], ending: str, notes: list[str]) -> None:
    """Add a sentence to the notes on units of tracks, by their names, that a file cannot hold."""
    found = [f"{name} ({unit})" for name, unit in units.items() if unit]
    note = f"units left out: {listed(found)}: {ending} does not hold them"
    if found and note not in notes:
        notes.append(note)


def _named(one: Attribute | FaceGroups) -> str:
    if isinstance(one, FaceGroups):
        return f"groups {one.name!r}"
    return f"{one.name!r} ({one.kind}) of each {one.domain}"
