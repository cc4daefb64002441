"""Sequences whose frames stay in their files, as opened by `encode` and `info`."""

from pathlib import Path

from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.options import Reading
from meshreel.formats.segments import open_any
from meshreel.formats.sources import find_files
from meshreel.model.surface import PLAIN


def open_source(source, *, topology=None, max_loaded_bytes=0, **options):
    """Open the sequence that `load` returns, with at most this many bytes of positions loaded."""
    topology = None if topology is None else Path(topology)
    reading = Reading(topology=topology, max_loaded_bytes=max_loaded_bytes, **options)
    opened = open_any(find_files(source), reading)
    return opened.segments[0] if opened.n_segments == 1 else opened


def count_runs(source, **options):
    """Return the number of ranges of frames with the same faces, as the files have them."""
    return open_any(find_files(source), Reading(matches_frames=False, **options)).n_segments


def stored(sequence, read_range, n_frames=None):
    """Return the mesh of a sequence with frames that `read_range` reads from start to stop."""
    return StoredFrames(
        n_frames=n_frames or sequence.n_frames,
        n_verts=sequence.n_verts,
        read_faces=lambda: sequence.faces,
        read_surface=lambda: PLAIN,
        read_tracks=dict,
        timing=sequence.timing,
        name=sequence.name,
        dtype=sequence.dtype,
        read_extent=lambda: sequence.extent,
        read_range=read_range,
    )
