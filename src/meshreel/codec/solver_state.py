"""Tracks in which a simulation stores the state of its solver, which few programs read later."""

from collections.abc import Collection, Iterable

from meshreel.codec.inspect import TrackInfo

SOLVER_STATE = frozenset(
    {
        "pprevious", "plast", "vprevious", "vlast",
        "orientprevious", "orientlast", "wprevious", "wlast",
        "oldP",
    }
)  # fmt: skip
"""Names of point attributes of Houdini with values of earlier steps.

The first eight are positions, velocities, orientations and angular velocities of the Vellum solver
("Dynamics: state" in its list of attributes); scripts of users often store positions of the frame
before as `oldP`.
"""


def solver_state_note(tracks: Iterable[TrackInfo], requested: Collection[str]) -> str | None:
    """Return a note on tracks of a stream that hold solver state, with their bytes.

    Parameters
    ----------
    tracks : iterable of TrackInfo
    requested : collection of str
        Names of tracks that the user gave a bound: these are not mentioned.

    Returns
    -------
    str or None
        None if there are no such tracks.
    """
    found = [one for one in tracks if one.name in SOLVER_STATE and one.name not in requested]
    if not found:
        return None
    sizes = ", ".join(f"{track.name} ({track.size_bytes} bytes)" for track in found)
    options = " ".join(f"--track {track.name}=drop" for track in found)
    return (
        f"by their names, these tracks hold the state of a Houdini solver: {sizes}; leave out what "
        f"nothing reads later with {options}"
    )
