"""What each stage of registration contributes: registers raw captures without it.

    python bench/registration_stages.py capture/ 'collision/*.obj' --frames 24
    python bench/registration_stages.py samba.npz jumping.npz --remesh --frames 16

Prints a table per capture: segments, surface PSNR before coding (single raw frames included), faces
that fold over, kilobits per frame and surface PSNR at quality 70, and processor seconds per frame.
"""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np

import meshreel
from measuring import start_table
from meshreel.codec.error_bounds import bound_of
from meshreel.registration import fitting, folds, growing, tracking, triangle_mesh
from meshreel.registration.fitting import Rows
from meshreel.registration.register import register
from meshreel.registration.tracking import ATTEMPTS
from meshreel.studies.timing import timed_once
from registration import as_segments, chosen, errors, frames_of, remeshed

QUALITY = 70


def rows_of_nothing(*_: Any) -> Rows:
    """Return no equations, in place of those of one direction."""
    empty = np.zeros((0, 3))
    return Rows(empty.astype(np.int32), empty, empty, np.zeros(0), np.zeros(0))


def one_topology(*_: Any) -> growing.Topology:
    """Return the same topology for every frame."""
    return growing.Topology(0, 0)


Change = tuple[Any, str, Any]


def unchanged(repair: str) -> Change:
    """Return the change by which a repair of folds leaves the mesh as it is."""
    return folds.Folds, repair, lambda self, mesh, *_: mesh


VARIANTS: dict[str, list[Change]] = {
    "all stages": [],
    "key in the middle, of any topology": [
        (growing.Topology, "of_mesh", staticmethod(one_topology))
    ],
    "correspondences by position alone": [(triangle_mesh, "NORMAL_WEIGHT", 0.0)],
    "no constant velocity": [
        (growing, "ATTEMPTS", tuple(attempt._replace(predicts=False) for attempt in ATTEMPTS))
    ],
    "stiff stages in every frame": [(growing, "ATTEMPTS", ATTEMPTS[2:])],
    "first attempt only": [(growing, "ATTEMPTS", ATTEMPTS[:1])],
    "folds are not opened to meet the tolerance": [(growing, "MAX_ERROR_TO_OPEN", 0.0)],
    "boundaries do not attract": [
        (tracking, "TANGENTIAL_AT_EDGE", tracking.TANGENTIAL),
    ],
    "details forgotten after each frame": [(tracking, "DETAIL_SHARE", 0.0)],
    "no fit": [(fitting.TwoSidedFit, "step", lambda self, mesh, *_: mesh.vertices)],
    "fit to the raw surface only": [(fitting, "rows_from_surface", rows_of_nothing)],
    "fit from the raw surface only": [(fitting, "rows_to_surface", rows_of_nothing)],
    "as fine as possible in every frame": [(growing, "SMOOTHNESS", growing.SMOOTHNESS[-1:])],
    "folds stay": [unchanged("flatten"), unchanged("open"), unchanged("restore")],
    "folds are only flattened": [unchanged("open"), unchanged("restore")],
    "folds are only opened": [unchanged("flatten"), unchanged("restore")],
    "folds are only restored": [unchanged("open"), unchanged("flatten")],
    "folds are not restored": [unchanged("restore")],
}


@contextmanager
def changed(changes: list[Change]) -> Iterator[None]:
    """Context manager in which attributes of modules or classes have other values."""
    with ExitStack() as stack:
        for place, name, value in changes:
            stack.enter_context(patch.object(place, name, value))
        yield


def main() -> None:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+", help="raw captures, or sequences with --remesh")
    parser.add_argument("--frames", type=int, default=24, help="number of frames [default: 24]")
    parser.add_argument("--tolerance", default="0.2%")
    parser.add_argument("--remesh", action="store_true")
    arguments = parser.parse_args()
    for source in arguments.sources:
        frames = frames_of(source, slice(arguments.frames))
        n_frames = len(frames)
        raw = as_segments(remeshed(frames) if arguments.remesh else frames)
        print(f"\n{source}, {n_frames} frames\n")
        header = ["segments", "dB", "folded faces", "kbit/frame", "dB, coded", "s/frame"]
        print_row = start_table("", *header)
        for name, changes in VARIANTS.items():
            with changed(changes):
                work = partial(register, raw, bound_of(arguments.tolerance), quality=QUALITY)
                registered, seconds = timed_once(work)
            data = meshreel.encode(registered.sequence, quality=QUALITY, order="drop")
            decoded, measured = meshreel.decode(data), range(0, n_frames, 4)
            coded, *_ = errors(chosen(raw, measured), chosen(decoded, measured), raw.extent)
            distances, n_segments = registered.distances, registered.sequence.n_segments
            kilobits, each_s = len(data) * 8e-3 / n_frames, seconds.processor / n_frames
            print_row(name, str(n_segments), f"{distances.psnr_db:.1f}", str(distances.n_folded),
                      f"{kilobits:.1f}", f"{coded:.1f}", f"{each_s:.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
