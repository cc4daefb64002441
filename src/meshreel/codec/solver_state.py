"""Detection of tracks that store the internal state of a simulation."""

from collections.abc import Collection, Iterable

from meshreel.codec.inspect import TrackInfo

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


def solver_state_note(tracks: Iterable[TrackInfo], requested: Collection[str]) -> str | None:
    """Describe the tracks of a stream that contain solver state, with their bytes.

    Parameters
    ----------
    tracks : iterable of TrackInfo
    requested : collection of str
        Names of tracks with a bound from the user, which are not mentioned.

    Returns
    -------
    str or None
        None without such tracks.
    """
    state = [
        track for track in tracks if track.name in SOLVER_STATE and track.name not in requested
    ]
    if not state:
        return None
    sizes = ", ".join(f"{track.name} ({track.size_bytes} bytes)" for track in state)
    return (
        f"by their names, these tracks contain the state of a Houdini solver: {sizes}; if nothing "
        "reads them later, drop these tracks"
    )
