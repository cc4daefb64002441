"""All quality metrics of a decoded sequence against its original."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import ConnectivityChangeError, InvalidInputError, Keyword
from meshreel.metrics.nmsve import nmsve_per_frame
from meshreel.metrics.normals import normal_angles
from meshreel.metrics.position_errors import ErrorSums, add_sequence, position_errors
from meshreel.metrics.reference import bounding_box_reference, reference_of_extent, shared_reference
from meshreel.metrics.sted import sted
from meshreel.metrics.track_errors import TrackErrors, errors_of_tracks
from meshreel.model.geometry.triangles import lowest_rotation
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices
from meshreel.model.tracks import describe_track
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.metrics.surface_distance import SurfaceQuality

REST_PERCENT = 0.001
"""A vertex rests if it moves less than this between frames, in percent of the mean diagonal of the
frames: about a hundredth of a pixel if the model fills the screen."""


@dataclass(frozen=True, eq=False)
class Quality:
    """Errors of a decoded sequence; all are 0 if it equals its original.

    Attributes
    ----------
    kg_error_percent : float
    sted, sted_spatial, sted_temporal : float, without unit
    nmsve : float64 array of shape (T,), without unit
    max_error_percent, rms_error_percent : float
        Vertex displacement in percent of `diagonal`.
    normal_angle_mean_deg, normal_angle_p95_deg : float
    n_degenerate_face_frames : int
        Faces without a normal, summed over the frames; excluded from the angles.
    n_rest_pairs : int
        Pairs of vertex and frame at which the original rests; see `rest_motion`.
    rest_motion_median_percent, rest_motion_p99_percent : float
        Median and 99th percentile of the decoded motion of these pairs since the previous frame,
        in percent of the mean diagonal of single frames; 0 if nothing rests.
    n_frames, n_verts : int
    diagonal : float
        Diagonal of the bounding box of the whole original sequence, in model units.
    tracks : dict of str to TrackErrors
        Errors of the tracks that both sequences have.
    """

    kg_error_percent: float
    sted: float
    sted_spatial: float
    sted_temporal: float
    nmsve: Floats
    max_error_percent: float
    rms_error_percent: float
    normal_angle_mean_deg: float
    normal_angle_p95_deg: float
    n_degenerate_face_frames: int
    n_rest_pairs: int
    rest_motion_median_percent: float
    rest_motion_p99_percent: float
    n_frames: int
    n_verts: int
    diagonal: float
    tracks: dict[str, TrackErrors]

    @property
    def nmsve_mean(self) -> float:
        """Mean of the NMSVE over the frames."""
        return float(self.nmsve.mean())

    def __repr__(self) -> str:
        return (
            f"<Quality: KG error {self.kg_error_percent:.4g} %, STED {self.sted:.4g}, "
            f"largest error {self.max_error_percent:.4g} %, RMS {self.rms_error_percent:.4g} %, "
            f"normals {self.normal_angle_mean_deg:.4g} deg; "
            f"{self.n_frames} frames, {self.n_verts} vertices>"
        )

    def as_dict(self) -> dict[str, Any]:
        """All metrics by name in plain Python types, with `nmsve_mean` and `nmsve` as a list."""
        tracks = {name: errors.as_dict() for name, errors in self.tracks.items()}
        lists = {"nmsve": self.nmsve.tolist(), "tracks": tracks}
        return {**vars(self), **lists, "nmsve_mean": self.nmsve_mean}


def compare(
    original: MeshSequence, decoded: MeshSequence, *, progress: Progress = silent
) -> Quality:
    """All quality metrics of a decoded sequence of the same mesh, as of `meshreel.compare`.

    Raises
    ------
    InvalidInputError
        If frame counts, vertex counts or triangles differ.
    """
    require_comparable(original, decoded)
    vertices, vertices_hat, faces = original.vertices, decoded.vertices, original.faces
    progress("comparing", 0.0)
    positions = position_errors(vertices, vertices_hat)
    progress("comparing", 0.1)
    sted_parts = sted(vertices, vertices_hat, faces)
    progress("comparing", 0.5)
    nmsve = nmsve_per_frame(vertices, vertices_hat, faces)
    progress("comparing", 0.7)
    angles = normal_angles(vertices, vertices_hat, faces)
    resting = rest_motion(vertices, vertices_hat)
    progress("comparing", 1.0)
    return Quality(
        kg_error_percent=positions.kg_error_percent,
        sted=sted_parts.sted,
        sted_spatial=sted_parts.spatial,
        sted_temporal=sted_parts.temporal,
        nmsve=nmsve,
        max_error_percent=positions.max_error_percent,
        rms_error_percent=positions.rms_error_percent,
        normal_angle_mean_deg=angles.mean_deg,
        normal_angle_p95_deg=angles.p95_deg,
        n_degenerate_face_frames=angles.n_degenerate_face_frames,
        n_rest_pairs=resting.n_pairs,
        rest_motion_median_percent=resting.median_percent,
        rest_motion_p99_percent=resting.p99_percent,
        n_frames=original.n_frames,
        n_verts=original.n_verts,
        diagonal=bounding_box_reference(vertices).diagonal,
        tracks=errors_of_tracks(original.tracks, decoded.tracks),
    )


def measure_quality(
    original: MeshSequence,
    decoded: MeshSequence,
    *,
    surface: bool | None = None,
    n_samples: int | None = None,
    progress: Progress = silent,
) -> "Quality | SurfaceQuality":
    """Compare vertices if both sequences have the same mesh, and surfaces otherwise.

    Parameters and errors are those of `meshreel.compare`, without files and dropped orders. A
    `SurfaceQuality` has the errors of vertices too, if the meshes of all segments are the same.
    """
    difference = connectivity_difference(original, decoded)
    if surface or (surface is None and difference):
        from meshreel.metrics import surface_distance

        distances = surface_distance.compare_surfaces(
            original,
            decoded,
            n_samples=surface_distance.N_SAMPLES if n_samples is None else n_samples,
            reason=difference or "requested",
            progress=progress,
        )
        pairs = list(zip(original.segments, decoded.segments, strict=False))
        counts = [
            [segment.n_frames for segment in sequence.segments] for sequence in (original, decoded)
        ]
        if counts[0] != counts[1] or any(mesh_difference(*pair) for pair in pairs):
            return distances
        sums = ErrorSums(reference_of_extent(original.extent))
        for segment, segment_hat in pairs:
            add_sequence(sums, segment, segment_hat)
        return replace(distances, vertex_errors=sums.errors)
    if n_samples is not None:
        raise InvalidInputError(
            Keyword("n_samples"),
            " has no effect where vertices are compared; ",
            Keyword("surface", True),
            " compares surfaces",
        )
    if original.n_segments > 1 or decoded.n_segments > 1:
        raise ConnectivityChangeError(
            f"{difference}; a comparison of vertices needs the same faces in every frame"
        )
    return compare(original, decoded, progress=progress)


def connectivity_difference(original: MeshSequence, decoded: MeshSequence) -> str:
    """Return how the meshes of two sequences differ, or "" if they are the same."""
    if original.n_segments > 1 or decoded.n_segments > 1:
        return "the faces change over time"
    return mesh_difference(original, decoded)


def mesh_difference(original: FrameSource, decoded: FrameSource) -> str:
    """Return how the meshes of two segments differ, or "" if they are the same."""
    for noun, count, count_hat in (
        ("vertex", original.n_verts, decoded.n_verts),
        ("face", len(original.faces), len(decoded.faces)),
    ):
        if count != count_hat:
            return f"the {noun} counts differ ({count} and {count_hat})"
    is_same = has_same_triangles(original.faces, decoded.faces, original.n_verts)
    return "" if is_same else "the faces differ"


def has_same_triangles(faces: Faces, faces_hat: Faces, n_verts: int) -> bool:
    """Return whether two lists of the same length contain the same oriented triangles."""
    if np.array_equal(faces, faces_hat):
        return True
    return _first_missing_face(faces, faces_hat, n_verts) is None


def require_comparable(original: FrameSource, decoded: FrameSource) -> None:
    """Check that two sequences agree in frame count, vertex count and oriented triangles.

    Raises
    ------
    InvalidInputError
        If they differ; the message has both counts, or the first missing face.
    """
    for name in original.tracks.keys() & decoded.tracks.keys():
        track, track_hat = original.tracks[name], decoded.tracks[name]
        if (track.domain, track.shape[2]) != (track_hat.domain, track_hat.shape[2]):
            raise InvalidInputError(
                f"track {name!r} of the original is {describe_track(track)}, of the decoded "
                f"{describe_track(track_hat)}; only tracks of the same kind can be compared"
            )
    for noun, count, count_hat in (
        ("vertex", original.n_verts, decoded.n_verts),
        ("frame", original.n_frames, decoded.n_frames),
        ("face", len(original.faces), len(decoded.faces)),
    ):
        if count != count_hat:
            raise InvalidInputError(
                f"the original has {counted(count, noun)} and the decoded {count_hat}; "
                "only sequences of the same mesh can be compared"
            )
    if not np.array_equal(original.faces, decoded.faces):
        require_same_triangles(original.faces, decoded.faces, original.n_verts)


def require_same_triangles(faces: Faces, faces_hat: Faces, n_verts: int) -> None:
    """Check that both lists contain the same oriented triangles with equal multiplicity.

    Raises
    ------
    InvalidInputError
        If a face of the original is missing from the decoded faces; the message has the first one.
    """
    row = _first_missing_face(faces, faces_hat, n_verts)
    if row is not None:
        raise InvalidInputError(
            f"face {row} of the original, {faces[row].tolist()}, is missing from the decoded faces "
            "in that orientation, or is rarer; only sequences of the same mesh can be compared"
        )


def _first_missing_face(faces: Faces, faces_hat: Faces, n_verts: int) -> int | None:
    """Return the first face that the other list lacks, or contains less often."""
    rotated = np.concatenate([lowest_rotation(each, n_verts)[0] for each in (faces, faces_hat)])
    _, ids = np.unique(rotated, axis=0, return_inverse=True)
    ids, ids_hat = np.split(ids.ravel(), 2)
    n_ids = len(rotated)
    surplus = np.bincount(ids, minlength=n_ids) - np.bincount(ids_hat, minlength=n_ids)
    is_missing = surplus[ids] > 0
    return int(np.argmax(is_missing)) if is_missing.any() else None


@dataclass(frozen=True)
class RestMotion:
    """Spurious motion of decoded vertices between frames in which the original rests.

    Percentages refer to the mean diagonal of the bounding boxes of single frames, so that a large
    overall path of the model does not hide its local motion.
    """

    n_pairs: int
    """Pairs of a vertex and a frame after the first in which the original moves by less than
    `REST_PERCENT` since the previous frame.
    """
    median_percent: float
    p99_percent: float
    """Median and 99th percentile of the decoded motion over these pairs; 0 if there are none."""


@np.errstate(over="ignore", invalid="ignore")
def rest_motion(original: Vertices, decoded: Vertices) -> RestMotion:
    """Median and 99th percentile of decoded motion where the original rests.

    Parameters
    ----------
    original, decoded : float arrays of shape (T, V, 3), in model units, all finite

    Raises
    ------
    InvalidInputError
        If the shapes differ.
    """
    scale = shared_reference(original, decoded).scale
    sides = [np.ptp(frame.astype(np.float64) * scale, axis=0) for frame in original]
    diagonal = float(np.linalg.norm(sides, axis=1).mean())
    threshold = REST_PERCENT / 100.0 * diagonal
    percents = [np.empty(0, np.float32)]
    for number in range(1, len(original)):
        rests = _steps(original, number, scale) < threshold
        if rests.any():
            steps = _steps(decoded, number, scale)[rests]
            percents.append((100.0 / diagonal * steps).astype(np.float32))
    motion = np.concatenate(percents)
    if not len(motion):
        return RestMotion(0, 0.0, 0.0)
    median, p99 = np.percentile(motion, [50, 99])
    return RestMotion(len(motion), float(median), float(p99))


def _steps(vertices: Vertices, number: int, scale: float) -> Floats:
    """Distance of each vertex from its position in the previous frame, in scaled units."""
    moves = np.subtract(vertices[number], vertices[number - 1], dtype=np.float64) * scale
    return np.asarray(np.sqrt(np.einsum("na,na->n", moves, moves)))
