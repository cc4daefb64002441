"""Detection of tracks that store the internal state of a simulation."""

from collections.abc import Collection, Iterable

from meshreel.codec.inspect import TrackInfo
from meshreel.model.notes import Note, NoteKind
from meshreel.runtime.counting import size_text

SOLVER_STATE = frozenset(
    {
        "pprevious", "plast", "vprevious", "vlast",
        "orientprevious", "orientlast", "wprevious", "wlast",
        "oldP",
    }
)  # fmt: skip
"""Names of Houdini point attributes with values of earlier steps.

The first eight are positions, velocities, orientations and angular velocities of the Vellum solver
("Dynamics: state" in its list of attributes); user scripts often store the previous positions as
`oldP`.
"""


def solver_state_note(tracks: Iterable[TrackInfo], requested: Collection[str]) -> Note | None:
    """Note that lists the tracks of a stream with solver state, and the sizes of all tracks.

    Parameters
    ----------
    requested : collection of str
        Names of tracks with a bound from the user, which are not mentioned.

    Returns
    -------
    Note or None
        None without such tracks.
    """
    candidates = [track for track in tracks if track.name not in requested]
    state = [track.name for track in candidates if track.name in SOLVER_STATE]
    if not state:
        return None
    candidates.sort(key=lambda track: -track.size_bytes)
    sizes = ", ".join(f"{track.name} ({size_text(track.size_bytes)})" for track in candidates)
    text = (
        f"by their names, these tracks contain the state of a Houdini solver: {', '.join(state)}; "
        f"tracks by size: {sizes}; if nothing reads them later, drop these tracks"
    )
    return Note(NoteKind.RESULT, "solver state", text=text)
