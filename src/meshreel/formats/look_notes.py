"""What is not kept of how materials look, each in one sentence that names them all."""

from meshreel.formats.notes import LEFT_OUT, listed


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
