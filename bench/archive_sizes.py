"""Bytes of whole simulation results: by gzip, zfp and SZ3 in HDF5, and as `.reel`.

    python bench/archive_sizes.py plate.e wing.case run.pvd crash/d3plot --bound 0.1

Column gzip: all arrays as given, by gzip 9 with shuffle; positions that never change are stored
once. Columns zfp and SZ3: the same, but floats of positions and tracks have the bounds of
`meshreel.encode(file, bound=...)`, values of vectors within the bound divided by the square root of
their number. The smaller one of two layouts counts, rows over time or one step after another, and
of two algorithms of SZ3, without headers of HDF5. NaN is replaced by the mean for them. Needs the
extras [peers,hdf] and those of the formats.
"""

import argparse
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

import meshreel
from fields import coded_bytes
from meshreel.model.sequence import FrameSource
from meshreel.studies.study import markdown_row

HEADER = "file", "nodes", "cells or faces", "steps", "tracks", "raw", "gzip", "zfp", "SZ3", "reel"
CODERS = "zfp", "SZ3"
GZIP = {"compression": "gzip", "compression_opts": 9, "shuffle": True}


def mesh_arrays(segment: FrameSource) -> Iterator[npt.NDArray[Any]]:
    """Yield all arrays but times, positions and tracks."""
    surface = segment.surface
    if surface.cells is not None:
        yield from (surface.cells.types, surface.cells.nodes)
    else:
        yield from (segment.faces, surface.sizes(len(segment.faces)))
    yield from (attribute.values for attribute in surface.attributes)
    yield from (group.numbers for group in surface.groups)


def moving_arrays(
    segment: FrameSource, diagonal: float
) -> Iterator[tuple[str, npt.NDArray[Any], float]]:
    """Yield name, values of shape (T, N, C) and range of positions and tracks; 0 if constant."""
    positions = segment.read(0, segment.n_frames)
    is_still = (positions == positions[0]).all()
    yield "positions", positions[: 1 if is_still else None], diagonal
    for name, track in segment.tracks.items():
        values = track.read(0, track.shape[0])
        span = np.nanmax(values, axis=(0, 1)) - np.nanmin(values, axis=(0, 1))
        yield name, values, float(np.linalg.norm(span)) if values.dtype.kind == "f" else 0.0


def row_of(path: Path, percent: float) -> list[object]:
    """Return a row of the table."""
    sequence = meshreel.load(path)
    data = meshreel.encode(sequence, bound=percent)
    info, exact, rest = meshreel.info(data), io.BytesIO(), io.BytesIO()
    raw, coded = 0, dict.fromkeys(CODERS, 0)
    with h5py.File(exact, "w") as given, h5py.File(rest, "w") as others:
        for number, segment in enumerate(sequence.segments):
            for at, array in enumerate([*mesh_arrays(segment), np.asarray(sequence.times)]):
                raw += array.nbytes
                for file in (given, others):
                    file.create_dataset(f"{number}/mesh/{at}", data=array, **GZIP)
            for name, values, span in moving_arrays(segment, info.diagonal):
                raw += values.nbytes
                for file in (given, others) if span == 0 else (given,):
                    file.create_dataset(f"{number}/values/{name}", data=values, **GZIP)
                tolerance = percent / 100 * span / np.sqrt(values.shape[2])
                for column in np.moveaxis(values, 2, 0).astype(float) if span else ():
                    column[np.isnan(column)] = np.nanmean(column)
                    streams = [*coded_bytes(column, tolerance)]
                    for coder in CODERS:
                        coded[coder] += min(size for size, by in streams if by == coder)
    sizes = [raw, len(exact.getvalue()), *(len(rest.getvalue()) + n for n in coded.values())]
    cells = sequence.segments[0].surface.cells
    n_items = cells.n_cells if cells else info.n_polygons or info.n_faces
    return [path.name, info.n_verts, n_items, info.n_frames, len(info.tracks), *sizes, len(data)]


def main() -> None:
    """Print a row for each file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--bound", type=float, default=0.1, help="percent of the range")
    arguments = parser.parse_args()
    print(markdown_row(HEADER), markdown_row(["---"] * len(HEADER)), sep="\n")
    for path in arguments.files:
        print(markdown_row(map(str, row_of(path, arguments.bound))), flush=True)


if __name__ == "__main__":
    main()
