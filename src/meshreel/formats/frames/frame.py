"""Contents of a file with one frame: mesh, surface and data."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import Field, Fields, Key, field_tracks
from meshreel.formats.frames.stored_frames import StoredTrack, checksum
from meshreel.formats.surfaces.hard_edges import HardEdges, NormalNotes
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes
from meshreel.model.surface import PLAIN, Attribute, Surface


def fields_of(attributes: Iterable[Attribute]) -> dict[Key, tuple[Values, Field]]:
    """Return attributes as the arrays of a frame, which become tracks if they change."""
    fields: dict[Key, tuple[Values, Field]] = {}
    for attribute in attributes:
        values = attribute.per_item()
        key = attribute.domain, attribute.name
        fields[key] = values, Field(values.dtype, values.shape[1], "", attribute.kind)
    return fields


@dataclass(frozen=True, eq=False)
class Frame:
    """Contents of a file with one frame."""

    mesh: PolygonMesh
    surface: Surface = PLAIN
    """Attributes, groups and parts, without face sizes and hard edges."""
    fields: Fields = field(default_factory=dict)
    """Vertex, face and corner data that become tracks if they change between files, or if the file
    declares them tracks. Otherwise the attributes of `surface` represent them.
    """
    notes: Notes = field(default_factory=Notes)
    """What reading changes or leaves out."""
    find_hard_edges: Callable[[], HardEdges | None] | None = None
    """Returns the hard edges with figures on the normals, or None; slow."""
    time_s: float | None = None
    """Time that the file states, in seconds."""

    def surface_with_edges(self, notes: Notes, *, finds_edges: bool = True) -> Surface:
        """Return the surface with its hard edges, if those are to be found.

        Notes receive figures on the normals, or that they are left out.
        """
        if self.find_hard_edges is None:
            return self.surface
        if not finds_edges:
            notes.left_out("hard edges of raw frames, and the normals or groups that define them")
            return self.surface
        if (hard_edges := self.find_hard_edges()) is None:
            return self.surface
        NormalNotes(notes).add("", hard_edges)
        return replace(self.surface, hard_edges=hard_edges.edges)


class FrameData:
    """The data of consecutive frames: descriptions, checksums and, unless forgotten, values.

    Values that are equal to those of the first frame are kept once.

    Parameters
    ----------
    first : Fields
        Data of the first frame.
    """

    def __init__(self, first: Fields) -> None:
        self._frames: list[Fields] = []
        self._descriptions: list[dict[Key, Field]] = []
        self._checksums: list[dict[Key, int]] = []
        self._has_values = True
        self.add(first)

    def add(self, fields: Fields) -> int:
        """Add the data of a frame; return the bytes of values that differ from the first."""
        sums = {key: checksum(values) for key, (values, _) in fields.items()}
        self._descriptions.append({key: field for key, (_, field) in fields.items()})
        self._checksums.append(sums)
        is_same = {key: self._checksums[0].get(key) == crc for key, crc in sums.items()}
        if self._has_values:
            first = self._frames[0] if self._frames else fields
            frame = {key: (first if is_same[key] else fields)[key] for key in fields}
            self._frames.append(frame)
        return sum(values.nbytes for key, (values, _) in fields.items() if not is_same[key])

    def forget_values(self) -> None:
        """Keep only descriptions and checksums."""
        self._frames, self._has_values = [], False

    @cached_property
    def changing_keys(self) -> set[Key]:
        """Data that change over time, are missing in some frames, or are declared tracks.

        Complete once all frames are added.
        """
        keys = {key for sums in self._checksums for key in sums}
        declared_keys = {
            key for fields in self._descriptions for key, field in fields.items() if field.is_track
        }
        return declared_keys | {
            key for key in keys if len({sums.get(key) for sums in self._checksums}) > 1
        }

    def tracks(
        self, mesh: PolygonMesh, read: Callable[[int], Fields], notes: Notes
    ) -> dict[str, StoredTrack]:
        """Return the data that change as tracks.

        Parameters
        ----------
        mesh : PolygonMesh
            Of any frame.
        read : function of a frame number
            Reads the data of a frame again if values are forgotten.
        notes : Notes
            Receives a sentence for each array that only some frames have.
        """
        frames, changing_keys = self._frames, self.changing_keys
        descriptions = [
            {key: field for key, field in fields.items() if key in changing_keys}
            for fields in self._descriptions
        ]

        def read_field(index: int, key: Key) -> Values:
            return (frames[index] if frames else read(index))[key][0]

        return field_tracks(descriptions, mesh.n_items, read_field, notes)
