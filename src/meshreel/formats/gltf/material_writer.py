"""Materials as they stand in a glTF file."""

from meshreel.formats.gltf.buffer_writer import Json


class Materials:
    """Materials by their labels, each written once.

    Attributes
    ----------
    listed : list of dict
        As they stand in the JSON.
    """

    def __init__(self) -> None:
        self.listed: list[Json] = []
        self._numbers: dict[str | None, int] = {}

    def number(self, label: str | None) -> int:
        """That of a label, or of faces without one: dull, and seen from both sides."""
        if label not in self._numbers:
            self._numbers[label] = len(self.listed)
            surface: Json = {"pbrMetallicRoughness": {"metallicFactor": 0}, "doubleSided": True}
            self.listed.append(surface if label is None else {"name": label} | surface)
        return self._numbers[label]
