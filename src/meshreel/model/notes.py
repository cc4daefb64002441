"""Notes for the user on what is read and written, worded alike for every format."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from enum import StrEnum
from typing import Any, Self

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import Keyword, Message, parts_of
from meshreel.model.cells import Cells
from meshreel.model.surface import Attribute, FaceGroups, Surface
from meshreel.model.timing import Timing
from meshreel.runtime.counting import counted

ASSUMED_FPS = 24.0
"""Frame rate of sequences without one, for our players and for formats that need a rate."""

NORMALS = "normals, which programs compute"
"""Subject of notes on stored normals."""

CAGES = "subdivision, whose cages are read"
"""Subject of notes on subdivision surfaces, which name the meshes."""

CHANGES = "changes over time, kept as in the first frame"
"""Subject of notes on contents that change in a way that a sequence cannot store."""

UNCHANGING = "data with a single sample, which cannot be a track"
"""Subject of notes on velocities and the like that have only one sample."""


class NoteKind(StrEnum):
    """Kinds of notes."""

    LEFT_OUT = "left out"
    """Contents of an input that are not read."""
    UNWRITTEN = "unwritten"
    """Contents that an output cannot store."""
    CHANGED = "changed"
    """Contents that are changed on reading or writing."""
    UNKNOWN = "unknown"
    """What an input does not state, and what is used instead."""
    SEGMENTS = "segments"
    """Ranges of frames with other faces."""
    RESULT = "result"
    """What was read or written: choices, errors and sizes."""


_BEGINNINGS = {NoteKind.LEFT_OUT: "left out: "}


class Note(Message):
    """A sentence for the user, which may name keywords.

    Parameters
    ----------
    subject : str
        What the note is about, such as "curves", "frame rate" or the name of a track; the whole
        sentence if no other note is similar.
    names : sequence of str
        Names of the things that it lists.
    text : str, optional
        The sentence; default: the subject with the names.
    """

    kind: NoteKind
    subject: str
    names: tuple[str, ...]

    def __new__(
        cls, kind: NoteKind, subject: str, names: Sequence[str] = (), text: str = ""
    ) -> Self:
        """Return a note."""
        contents = f"{subject}: {listed(names)}" if names else subject
        sentence = text or Message.prefixed(_BEGINNINGS.get(kind, ""), contents)
        note = super().__new__(cls, *parts_of(sentence))
        note.kind, note.subject, note.names = kind, subject, tuple(names)
        return note

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.kind, self.subject, self.names, Message(*self.parts)

    @property
    def contents(self) -> str:
        """The subject with the names, as in "curves: /a, /b"."""
        return f"{self.subject}: {listed(self.names)}" if self.names else self.subject


class Notes(list[Note]):
    """Notes in the order in which they were added."""

    def add(self, kind: NoteKind, subject: str, text: str = "") -> None:
        """Add a note, unless there is one with the same sentence."""
        self.add_all([Note(kind, subject, text=text)])

    def add_all(self, notes: Iterable[Note]) -> None:
        """Add notes whose sentences are new."""
        self.extend(note for note in notes if note not in self)

    def changed(self, subject: str, text: str = "") -> None:
        """Note that contents are changed on reading or writing."""
        self.add(NoteKind.CHANGED, subject, text)

    def unwritten(self, subject: str, text: str = "", names: Sequence[str] = ()) -> None:
        """Note that an output cannot store contents, which have names."""
        self.add_all([Note(NoteKind.UNWRITTEN, subject, names, text)])

    def unknown(self, subject: str, text: str = "") -> None:
        """Note what an input does not state, and what is used instead."""
        self.add(NoteKind.UNKNOWN, subject, text)

    def result(self, subject: str, text: str = "") -> None:
        """Note what was read or written: a choice, an error or a size."""
        self.add(NoteKind.RESULT, subject, text)

    def left_out(self, subject: str, names: Iterable[str] | None = None) -> None:
        """Note that contents of an input are left out, as in "curves: /a, /b", if any."""
        if names is None:
            self.add(NoteKind.LEFT_OUT, subject)
        else:
            self.list_names(NoteKind.LEFT_OUT, subject, names)

    def left_out_items(self, items: Iterable[tuple[str, str]]) -> None:
        """Note that contents of an input are left out, given the subject and name of each."""
        names: dict[str, list[str]] = {}
        for subject, name in items:
            names.setdefault(subject, []).append(name)
        for subject in names:
            self.left_out(subject, names[subject])

    def list_names(self, kind: NoteKind, subject: str, names: Iterable[str]) -> None:
        """List names in the note of this kind and subject, which is added if there is none."""
        distinct = dict.fromkeys(names)
        if not distinct:
            return
        for index, note in enumerate(self):
            if note.names and (note.kind, note.subject) == (kind, subject):
                self[index] = Note(kind, subject, [*dict.fromkeys([*note.names, *distinct])])
                return
        self.append(Note(kind, subject, [*distinct]))

    def merge(self, others: Iterable[Note]) -> None:
        """Add notes on a similar input: names to those of the same subject, and new subjects."""
        subjects = {(note.kind, note.subject) for note in self}
        for note in others:
            if note.names:
                self.list_names(note.kind, note.subject, note.names)
            elif (note.kind, note.subject) not in subjects:
                self.append(note)

    def discard(self, subject: str) -> None:
        """Remove the notes on a subject."""
        self[:] = [note for note in self if note.subject != subject]

    def combine(self) -> None:
        """Combine notes on several segments that differ in details.

        The first note of each kind and subject replaces the others, and says that other segments
        are similar.
        """
        groups: dict[object, list[Note]] = {}
        for note in self:
            groups.setdefault((note.kind, note.subject), []).append(note)
        self.clear()
        for first, *others in groups.values():
            if {*others} - {first}:
                text = Message(*first.parts, "; other segments similarly")
                first = Note(first.kind, first.subject, first.names, text)
            self.append(first)


MAX_NAME = 500
"""Maximum number of characters of a name in a list."""


def listed(names: Iterable[str], most: int = 8) -> str:
    """Join names in one line, shortening long lists and names: "a, b and 3 more"."""
    texts = list(names)
    ending = f" and {len(texts) - most} more" if len(texts) > most else ""
    shown = (name if len(name) <= MAX_NAME else f"{name[:MAX_NAME]}..." for name in texts[:most])
    return ", ".join(shown) + ending


def note_normals(notes: Notes) -> None:
    """Add a note that stored normals are left out."""
    notes.left_out(NORMALS)


def note_unknown_rate(notes: Notes, n_frames: int, fps: float) -> None:
    """Add a note if an animation has no frame rate."""
    if n_frames > 1 and not fps:
        text = Message(
            "the frame rate is unknown, and stored as unknown: players assume "
            f"{ASSUMED_FPS:g} frames per second; set it with ",
            Keyword("fps"),
        )
        notes.unknown("frame rate", text)


def written_rate(timing: Timing, notes: Notes) -> float:
    """Return the rate for a format without frame times; add a note if it is not the actual one."""
    if timing.times is not None:
        text = f"frame times are uneven; written as {timing.fps:g} frames per second"
        notes.changed("frame times", text)
    elif not timing.fps:
        text = f"the frame rate is unknown; written as {ASSUMED_FPS:g} fps"
        notes.unknown("frame rate", text)
    return timing.fps or ASSUMED_FPS


def written_times(timing: Timing, n_frames: int, notes: Notes) -> Floats:
    """Return the time of each frame in seconds, of shape (T,), as `written_rate`."""
    if timing.times is not None:
        return timing.times
    if n_frames == 1:
        return np.array([timing.start_s])
    times: Floats = timing.start_s + np.arange(n_frames) / written_rate(timing, notes)
    return times


def note_unwritten_times(timing: Timing, n_frames: int, extension: str, notes: Notes) -> None:
    """Add a note on frame rate, times and start that files of one frame cannot store."""
    facts = []
    if n_frames > 1 and timing.times is not None:
        facts.append("frame times")
    elif n_frames > 1 and timing.fps:
        facts.append(f"the frame rate of {timing.fps:g} per second")
    if timing.start_s:
        facts.append(f"the start at {timing.start_s:g} s")
    _note_unwritable(notes, extension, facts)


def note_unwritten(
    surface: Surface,
    written: Collection[Attribute | FaceGroups | None],
    extension: str,
    notes: Notes,
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
    contents: list[Attribute | FaceGroups] = [*surface.attributes, *surface.groups]
    missing = [_describe(item) for item in contents if not any(item is other for other in written)]
    if surface.parts and not parts:
        missing.append(f"the names of {len(surface.parts)} parts")
    if surface.face_sizes is not None and not polygons:
        missing.append("faces with more than three corners, which are triangulated")
    if surface.hard_edges is not None and not hard_edges:
        missing.append(counted(len(surface.hard_edges), "hard edge"))
    _note_unwritable(notes, extension, missing)


def note_unwritten_materials(surface: Surface, extension: str, notes: Notes) -> None:
    """Add a note on materials and images that a file cannot store.

    Parameters
    ----------
    extension : str
        Of the file, with the dot.
    """
    missing = []
    if surface.materials:
        names = listed(material.name for material in surface.materials)
        missing.append(f"material properties ({names})")
    if surface.images:
        missing.append(counted(len(surface.images), "texture image"))
    _note_unwritable(notes, extension, [" and ".join(missing)] if missing else [])


def _note_unwritable(notes: Notes, extension: str, missing: Sequence[str]) -> None:
    if missing:
        subject = ", ".join(missing)
        text = f"left out, as {extension} files cannot store it: {subject}"
        notes.unwritten(subject, text)


def note_unwritten_tracks(
    names: Iterable[str], extension: str, notes: Notes, which: str = "them"
) -> None:
    """Add a note on tracks that a file cannot store; none if there are no names.

    Parameters
    ----------
    extension : str
        Of the file, with the dot.
    which : str
        What the file cannot store, such as "tracks of corners".
    """
    if tracks := list(names):
        text = f"tracks left out: {listed(tracks)}: {extension} cannot store {which}"
        notes.unwritten("tracks", text, tracks)


def note_unwritten_cells(cells: Cells, names: Sequence[str], extension: str, notes: Notes) -> None:
    """Add a note that a file stores only the surface of cells, without these values of cells."""
    values = f", and {listed(names)} of them" if names else ""
    text = f"{counted(cells.n_cells, 'cell')} left out{values}: {extension} stores their surface"
    notes.unwritten("cells", text)


def note_name(noun: str, name: str, file_name: str, extension: str, notes: Notes) -> None:
    """Add a note, once, if something has another name in a file.

    Parameters
    ----------
    noun : str
        Kind of the thing, such as "track" or "material".
    name, file_name : str
        Its name, and its name in the file.
    extension : str
        Of the file, with the dot.
    """
    if name != file_name:
        text = f"{noun} {name!r} is called {file_name!r} in {extension} files"
        notes.changed(name, text)


def note_track_type(name: str, dtype: object, stored_dtype: object, notes: Notes) -> None:
    """Add a note, once, if the values of a track are converted to another type."""
    if dtype != stored_dtype:
        text = f"track {name!r} is written as {stored_dtype}, not {dtype}"
        notes.changed(name, text)


def note_unwritten_units(units: Mapping[str, str], extension: str, notes: Notes) -> None:
    """Add a note on units of tracks, by track name, that a file cannot store."""
    if with_unit := [f"{name} ({unit})" for name, unit in units.items() if unit]:
        text = f"units left out: {listed(with_unit)}: {extension} cannot store them"
        notes.unwritten("units", text, with_unit)


def _describe(contents: Attribute | FaceGroups) -> str:
    if isinstance(contents, FaceGroups):
        return f"groups {contents.name!r}"
    return f"{contents.name!r} ({contents.kind}) of each {contents.domain}"
