"""One sentence on all things of a kind, as meshes are read one after the other."""

from collections.abc import Callable, Sequence


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
