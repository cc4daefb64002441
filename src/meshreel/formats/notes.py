"""Notes for the user on what a reader or writer leaves out, worded alike for every format."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from meshreel.model.surface import Attribute, FaceGroups, Surface
from meshreel.runtime.counting import counted

LEFT_OUT = "left out: "
"""Start of notes on input contents that no output will have."""


NORMALS_LEFT_OUT = f"{LEFT_OUT}normals, which programs compute"
"""Note on stored normals."""

NORMALS_FAR = "normals do not follow from the faces at "
"""Start of the note on stored normals that differ from the computed ones."""

ASSUMED_FPS = 24
"""Frame rate that our players assume for streams without one."""

UNCHANGING = "data with a single sample, which cannot be a track"
"""How notes name velocities and the like that have only one sample."""


def note_left_out(notes: list[str], what: str) -> None:
    """Add a note that something is left out, once.

    Parameters
    ----------
    what : str
        Kind and names, as in "fields that change over time: pressure, velocity".
    """
    note = f"{LEFT_OUT}{what}"
    if note not in notes:
        notes.append(note)


def listed(names: Iterable[str], most: int = 8) -> str:
    """Join names in one line, shortening long lists: "a, b and 3 more"."""
    found = list(names)
    rest = f" and {len(found) - most} more" if len(found) > most else ""
    return ", ".join(found[:most]) + rest


def note_moving(notes: list[str], names: Iterable[str]) -> None:
    """Add a note on fields that are left out because they change over time."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"fields that change over time: {listed(found)}")


def note_frozen(notes: list[str], names: Iterable[str]) -> None:
    """Add a note on attributes whose changes are ignored."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"changes over time of {listed(found)}, kept as in the first frame")


def note_unknown_rate(notes: list[str], n_frames: int, fps: float) -> None:
    """Add a note if an animation has no frame rate."""
    if n_frames > 1 and not fps:
        notes.append(
            "the frame rate is unknown, and stored as unknown: players assume "
            f"{ASSUMED_FPS} frames per second; set it with --fps (fps=)"
        )


def note_kinds(notes: list[str], kind: str, names: Iterable[str]) -> None:
    """Add a note that things of a kind are left out, as in "curves: /a, /b"; none if no names."""
    if found := list(dict.fromkeys(names)):
        note_left_out(notes, f"{kind}: {listed(found)}")


def note_normals(notes: list[str]) -> None:
    """Add a note that stored normals are left out."""
    note_left_out(notes, NORMALS_LEFT_OUT.removeprefix(LEFT_OUT))


def describe_cages(names: Sequence[str]) -> str:
    """Return the sentence on subdivision surfaces read as their cage, for a `GatheredNote`."""
    cages = "whose cage is read" if len(names) == 1 else "whose cages are read"
    return f"{LEFT_OUT}subdivision of {listed(names)}, {cages}"


class GatheredNote:
    """A note that is replaced by a longer one with each added name.

    Parameters
    ----------
    notes : list of str
        Receives the sentence.
    sentence : function of a non-empty list of names
        Returns the sentence; `listed` shortens long lists.
    """

    def __init__(self, notes: list[str], sentence: Callable[[Sequence[str]], str]) -> None:
        self._notes, self._sentence = notes, sentence
        self._names: list[str] = []

    def add(self, name: str) -> None:
        """Add a name, unless it is already in the note."""
        if name in self._names:
            return
        if self._names and (previous := self._sentence(self._names)) in self._notes:
            self._notes.remove(previous)
        self._names.append(name)
        self._notes.append(self._sentence(self._names))


class MaterialNotes:
    """Notes on materials that grow as further materials are read.

    Parameters
    ----------
    notes : list of str
        Receives a sentence for each property that is left out.
    """

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._names: dict[str, dict[str, None]] = {}

    def add(self, what: str, name: str) -> None:
        """Add that a property of a material is left out."""
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
    extension: str,
    notes: list[str] | None,
    *,
    parts: bool = False,
    polygons: bool = True,
    hard_edges: bool = False,
) -> None:
    """Add a note on the parts of a surface that a file cannot store.

    Parameters
    ----------
    written : collection of Attribute, FaceGroups or None
        Attributes and groups that the file stores.
    extension : str
        File extension with the dot.
    parts, polygons, hard_edges : bool
        Whether the file stores parts, polygons, and hard edges.
    """
    everything: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    missing = [_describe(one) for one in everything if not any(one is other for other in written)]
    if surface.parts and not parts:
        missing.append(f"the names of {len(surface.parts)} parts")
    if surface.face_sizes is not None and not polygons:
        missing.append("faces with more than three corners, which are triangulated")
    if surface.hard_edges is not None and not hard_edges:
        missing.append(counted(len(surface.hard_edges), "hard edge"))
    if missing and notes is not None:
        notes.append(f"left out, as {extension} files cannot store it: {', '.join(missing)}")


def note_unwritten_materials(surface: Surface, extension: str, notes: list[str]) -> None:
    """Add a note on materials and images that a file cannot store.

    Parameters
    ----------
    extension : str
        Of the file, with the dot.
    """
    missing = []
    if surface.materials:
        missing.append(f"material properties ({listed(one.name for one in surface.materials)})")
    if n_images := len(surface.images):
        missing.append(f"{n_images} texture image{'s' if n_images > 1 else ''}")
    note = f"left out, as {extension} files cannot store it: {' and '.join(missing)}"
    if missing and note not in notes:
        notes.append(note)


def note_unwritten_tracks(
    names: Iterable[str], extension: str, notes: list[str], which: str = "them"
) -> None:
    """Add a note on tracks that a file cannot store; none if there are no names.

    Parameters
    ----------
    names : iterable of str
    extension : str
        Of the file, with the dot.
    which : str
        What the file cannot store, such as "tracks of corners".
    """
    if found := list(names):
        notes.append(f"tracks left out: {listed(found)}: {extension} cannot store {which}")


def note_track_name(name: str, called: str, extension: str, notes: list[str]) -> None:
    """Add a note, once, if a track has another name in a file."""
    note_name("track", name, called, extension, notes)


def note_name(what: str, name: str, called: str, extension: str, notes: list[str]) -> None:
    """Add a note, once, if something has another name in a file.

    Parameters
    ----------
    what : str
        Kind of the thing, such as "track" or "material".
    name, called : str
        Its name, and its name in the file.
    extension : str
        Of the file, with the dot.
    """
    note = f"{what} {name!r} is called {called!r} in {extension} files"
    if name != called and note not in notes:
        notes.append(note)


def note_track_type(name: str, given: object, written: object, notes: list[str]) -> None:
    """Add a note, once, if the values of a track are converted to another type."""
    note = f"track {name!r} is written as {written}, not {given}"
    if given != written and note not in notes:
        notes.append(note)


def note_unwritten_units(units: Mapping[str, str], extension: str, notes: list[str]) -> None:
    """Add a note on units of tracks, by track name, that a file cannot store."""
    found = [f"{name} ({unit})" for name, unit in units.items() if unit]
    note = f"units left out: {listed(found)}: {extension} cannot store them"
    if found and note not in notes:
        notes.append(note)


def _describe(one: Attribute | FaceGroups) -> str:
    if isinstance(one, FaceGroups):
        return f"groups {one.name!r}"
    return f"{one.name!r} ({one.kind}) of each {one.domain}"
