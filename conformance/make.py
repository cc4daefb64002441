"""Generate streams of every feature of the format, with descriptions of their contents.

`python -m conformance.make` writes missing files: conformance/streams/NAME.reel and NAME.json for
every name in `STREAMS`, conformance/refused/NAME.reel for every name in `REFUSED`, and those of
`conformance.segments` in conformance/segments. Only `--force` replaces existing files.
"""

import argparse
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

import meshreel
from conformance import segments
from conformance.by_hand import (
    BY_HAND,
    HEAT,
    REEL,
    bare,
    cells_and,
    cells_and_payload,
    cells_payload,
    compact_and,
    doubles,
    heated,
    of_cells,
    of_lossy_and,
    quadratic,
    quantized,
    standing,
    stencils,
    swinging,
    three_frames,
    with_adaptive_cosines,
    with_attribute,
    with_cells,
    with_cosines,
    with_error_bound,
    with_exact_tracks,
    with_high_rate,
    with_long_name,
    with_nugget,
    with_relations,
    with_rests,
    with_runs,
    with_section,
    with_signs,
    with_triangles_apart,
)
from conformance.description import describe_all
from conformance.reader import read_all
from conformance.sources import (
    book,
    boxes,
    faceted,
    fan,
    grid,
    holes,
    moving,
    of_boxes,
    of_everything,
    pinched,
    shuffled,
    shuffled_cells,
    sphere,
    tangled,
    tetrahedra,
    together,
    uneven,
)
from meshreel.codec.bitstream import container as stream_container
from meshreel.codec.bitstream.container import (
    MAX_COMPACT,
    write_varint,
    write_varints,
)
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.tracks import Coding, TrackHeader, write_track
from meshreel.kernel.integers import encode_integers
from meshreel.model.surface import Domain

FOLDER = Path(__file__).with_name("streams")
REFUSED_FOLDER = Path(__file__).with_name("refused")


def encoded(sequence, **options):
    """Return a function that encodes the sequence that another one makes."""
    return lambda: meshreel.encode(sequence(), **options)


STREAMS: dict[str, Callable[[], bytes]] = {
    # Meshes of every kind, method `reel`.
    "sheet": encoded(lambda: moving(grid(10, 11))),
    "one_face": encoded(lambda: moving([[0, 1, 2]], 3)),
    "one_frame": encoded(lambda: moving(sphere(5, 8), 1), order="keep"),
    "two_frames": encoded(lambda: moving(grid(6, 6), 2), order="drop"),
    "sphere": encoded(lambda: moving(sphere(7, 12)), order="drop"),
    "torus": encoded(lambda: moving(shuffled(grid(9, 12, closed=(True, True)))), order="drop"),
    "tube": encoded(lambda: moving(grid(8, 12, closed=(False, True))), order="vertices"),
    "moebius": encoded(
        lambda: moving(grid(20, 4, closed=(True, False), turned=True)), order="drop"
    ),
    "turned_over": encoded(lambda: moving(shuffled(sphere(6, 9), turns=True)), order="keep"),
    "holes": encoded(lambda: moving(holes(13, 13)), order="drop"),
    "large_resolution": encoded(
        lambda: moving(grid(64, 65), 2), effort=1, quality=15, order="drop"
    ),
    "handles": encoded(
        lambda: moving(together(grid(6, 8, closed=(True, True)), grid(5, 7, closed=(True, True)))),
        order="drop",
    ),
    "components": encoded(
        lambda: moving(together(grid(6, 7), sphere(4, 7), [[0, 1, 2]], grid(3, 5)), n_more=3)
    ),
    "pinched": encoded(lambda: moving(pinched()), order="drop"),
    "not_manifold": encoded(
        lambda: moving(together(book(7), tangled(15, 24), grid(4, 5))), order="drop"
    ),
    "degenerate": encoded(
        lambda: moving(
            np.concatenate([grid(6, 6), [[3, 3, 4], [5, 5, 5], [7, 8, 7]], grid(3, 3)]), n_more=2
        )
    ),
    "tangled": encoded(lambda: moving(tangled(40, 60)), order="vertices"),
    "hub": encoded(lambda: moving(fan(60)), order="drop"),
    "hub_in_order": encoded(lambda: moving(shuffled(fan(45))), order="keep"),
    "uneven": encoded(lambda: moving(uneven()), order="drop"),
    "long_ring": encoded(
        lambda: moving(grid(3, 90, closed=(True, True)), 5), order="drop", effort=1
    ),
    # Orders.
    "order_shuffled": encoded(lambda: moving(shuffled(grid(9, 9)), 5), order="keep"),
    "order_of_vertices": encoded(lambda: moving(shuffled(sphere(6, 9)), 5), order="vertices"),
    "order_of_strips": encoded(
        lambda: moving(grid(4, 30)[np.argsort(np.arange(174) % 3, kind="stable")], 4)
    ),
    # Efforts, tunes and targets.
    **{
        f"effort_{effort}": encoded(lambda: moving(sphere(5, 9), 9, rough=0.01), effort=effort)
        for effort in range(1, 10)
    },
    "fine": encoded(lambda: moving(grid(7, 7), 12, rough=0.02), quality=100, order="drop"),
    "coarse": encoded(lambda: moving(grid(9, 9), 12), quality=5, order="drop"),
    "geometry": encoded(lambda: moving(grid(9, 9), 12), tune="geometry", order="drop"),
    "max_error": encoded(lambda: moving(sphere(5, 9), 12, rough=0.02), max_error=0.02, effort=5),
    "max_error_in_blocks": encoded(
        lambda: moving(holes(8, 8), 14, rough=0.01, n_more=1),
        max_error=0.3,
        effort=5,
        block_frames=5,
    ),
    "few_modes": encoded(lambda: moving(grid(8, 8), 12), n_modes=2, order="drop"),
    "blocks": encoded(lambda: moving(grid(8, 9), 17), block_frames=5, order="drop"),
    "blocks_of_one": encoded(lambda: moving(grid(5, 5), 4), block_frames=1, order="drop"),
    # Number types and placements.
    "doubles": encoded(lambda: moving(grid(7, 8), dtype=np.float64), order="vertices"),
    "far_away": encoded(
        lambda: moving(grid(7, 8), dtype=np.float64, shape=(1e-3, 1e9)), order="drop"
    ),
    "huge": encoded(lambda: moving(grid(7, 8), shape=(1e38, 0.0)), order="drop"),
    "tiny": encoded(lambda: moving(grid(7, 8), shape=(1e-40, 0.0)), order="drop"),
    "still": encoded(lambda: moving(grid(6, 6), 6, n_waves=0), order="drop"),
    "fast": encoded(lambda: moving(grid(4, 4), 3, fps=1e10)),
    "named": encoded(
        lambda: moving(grid(4, 4), 3, fps=23.976, name="N\u00e4me \u2603", start_s=41.7)
    ),
    # Attributes, groups, polygons, parts, materials, images.
    "everything": encoded(lambda: of_everything(fps=25.0, start_s=-1.5)),
    "everything_quantised": encoded(lambda: of_everything(np.float64), uv_bits=10),
    "attributes_of_vertices": encoded(of_everything, order="vertices"),
    "attributes_dropped_order": encoded(of_everything, order="drop", uv_bits=16),
    "hard_edges": encoded(of_boxes),
    "hard_edges_of_triangles": encoded(of_boxes, order="vertices"),
    "hard_edges_everywhere": encoded(
        lambda: faceted(grid(9, 11, closed=(True, False))), order="drop"
    ),
    "hard_edges_of_tangled": encoded(lambda: faceted(tangled(24, 60))),
    # The paper's methods.
    **{
        f"paper_{method}": encoded(lambda: moving(grid(6, 7), 9, n_more=2), method=method)
        for method in ("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "gft")
    },
    "paper_blocks": encoded(
        lambda: moving(grid(6, 7), 17, n_more=1), method="blocks", block_frames=4
    ),
    "paper_whole_dictionaries": encoded(
        lambda: moving(grid(6, 7), 17, n_more=1),
        method="blocks",
        block_frames=4,
        choices={"dictionary": "whole", "anchor_values": "coefficients"},
    ),
    "paper_cotangent": encoded(
        lambda: moving(grid(6, 7), 9, n_more=2), method="pca-qp", laplacian="cotangent"
    ),
    "paper_steps": encoded(
        lambda: moving(sphere(4, 7), 9),
        method="pca-qp",
        bits=[12, 9, 0],
        n_modes=3,
        laplacian="combinatorial",
    ),
    "paper_constant": encoded(
        lambda: moving(sphere(4, 7), 9), method="pca-qp", allocation="constant"
    ),
    "paper_exact_doubles": encoded(
        lambda: moving(grid(4, 4), 9, n_more=5, dtype=np.float64), method="v2v", order="drop"
    ),
    "stencils_1_to_5": lambda: stencils(range(1, 6), grid(6, 7), 3, 1),
    "stencils_6_to_10": lambda: stencils(range(6, 11), sphere(4, 9), 0, 2),
    "stencils_11_to_16": lambda: stencils(range(11, 17), uneven(n_verts=50), 9, 3),
    "edited_alone": lambda: segments.separated(segments.edited(2), 3),
    "adaptive_swings": encoded(swinging, order="drop"),
    **{
        f"exact_{number_type}": encoded(
            lambda dtype=number_type: with_exact_tracks(dtype, "vertex", 30),
            order="keep" if number_type == "u1" else "drop",
            block_frames=4,
            tracks={"x": "exact"},
        )
        for number_type in ("u1", "i2", "u4", "i8", "f4", "f8")
    },
    **{
        f"exact_of_{domain}s": encoded(
            lambda domain=domain, n_items=n_items: with_exact_tracks("i4", domain, n_items)
        )
        for domain, n_items in (("face", 40), ("corner", 120))
    },
    "exact_in_runs": encoded(with_runs, order="keep", tracks={"runs": "exact"}),
    # Exact positions.
    "lossless": encoded(lambda: moving(grid(8, 9), 12, rough=0.001), lossless=True),
    "lossless_doubles": encoded(
        lambda: moving(sphere(5, 9), 9, dtype=np.float64, shape=(3.0, 1e5), rough=0.001),
        method="lossless",
        order="vertices",
    ),
    "lossless_one_frame": encoded(lambda: moving(sphere(6, 9), 1), lossless=True, order="drop"),
    "lossless_in_blocks": encoded(
        lambda: with_signs(
            moving(together(grid(5, 6), sphere(4, 7), [[70, 70, 71]]), 11, n_more=2)
        ),
        lossless=True,
        block_frames=6,
    ),
    "lossless_still": encoded(lambda: moving(grid(12, 12), 40, n_waves=0), lossless=True),
    "lossless_with_tracks": encoded(
        lambda: with_exact_tracks("f8", "vertex", 30), lossless=True, block_frames=4
    ),
    # Positions on a grid, or exact if that takes fewer bytes.
    "grid": encoded(lambda: moving(grid(8, 9), 12, rough=0.001), method="grid", max_error=0.02),
    "grid_doubles": encoded(
        lambda: moving(sphere(5, 9), 9, dtype=np.float64, shape=(3.0, 1e5), rough=0.001),
        method="grid",
        max_error=0.001,
        order="vertices",
        block_frames=4,
    ),
    "grid_or_exact": encoded(
        lambda: with_signs(
            moving(together(grid(5, 6), sphere(4, 7), [[70, 70, 71]]), 11, n_more=2)
        ),
        method="grid",
        max_error=0.0001,
    ),
    "grid_with_tracks": encoded(
        lambda: with_exact_tracks("f8", "vertex", 30),
        method="grid",
        max_error=0.01,
        block_frames=4,
        tracks={"x": "exact"},
    ),
    "grid_one_frame": encoded(
        lambda: moving(shuffled(holes(10, 11)), 1, rough=0.01),
        method="grid",
        max_error=0.05,
        order="drop",
    ),
    "grid_one_frame_not_manifold": encoded(
        lambda: moving(
            together(book(7), tangled(15, 40), grid(4, 5)),
            1,
            n_more=3,
            dtype=np.float64,
            rough=0.01,
        ),
        method="grid",
        max_error=1e-6,
        order="vertices",
    ),
    "grid_still": encoded(
        lambda: standing(moving(shuffled(holes(6, 7)), 1, rough=0.01)),
        max_error=0.05,
        block_frames=4,
    ),
    "grid_still_cells": encoded(lambda: standing(of_cells(12, *boxes(3, 2, 2))), max_error=0.1),
    "grid_one_frame_listed": encoded(
        lambda: moving(together(grid(4, 5), tangled(12, 20)), 1, rough=0.01),
        method="grid",
        max_error=0.01,
        order="keep",
    ),
    "grid_rounded": encoded(
        lambda: quantized(grid(14, 15)), method="grid", max_error=1, order="drop"
    ),
    "lossless_rounded": encoded(lambda: quantized(grid(14, 15)), lossless=True, order="keep"),
    "cells_walked": encoded(lambda: of_cells(12, *shuffled_cells(*boxes(4, 3, 3)))),
    "cells_dropped": encoded(lambda: of_cells(12, *shuffled_cells(*boxes(4, 3, 3))), order="drop"),
    "cells_tetrahedra": encoded(
        lambda: of_cells(10, boxes(3, 3, 2)[0], tetrahedra(*boxes(3, 3, 2))), order="drop"
    ),
    "cells_quadratic": encoded(
        lambda: of_cells(25, *shuffled_cells(*quadratic(25, *boxes(3, 2, 2)))), order="drop"
    ),
    "cells_exact": encoded(lambda: of_cells(12, *boxes(3, 2, 2)), lossless=True),
    "cells_of_one_frame": encoded(lambda: of_cells(12, *boxes(3, 2, 2), n_frames=1), max_error=0.1),
    # Written section by section, or with checks of what the encoder chose.
    **{make.__name__: make for make in BY_HAND},
}

START = (Section.START, bytes(8))
TIMES = (Section.TIMES, b"\0" + bytes(8))
OF_NO_CELLS = TrackHeader(
    "stress", "", "scalar", Domain.CELL, np.dtype(np.float32), 1.0, (0.0,), Coding.EXACT
)
NO_ROUNDING = write_varints(0, 0, 0) + encode_integers(
    [np.zeros(1, int)] * 3 + [np.zeros(0, int)] * 3
)
ON_GRID = Section.VALUES, b"\1" + np.float64(0.5).tobytes() + bytes(8)
EXTRAPOLATED = Section.VALUES, b"\6" + np.float32(0.01).tobytes()  # all bits are 1
SEGMENT = write_varints(3, 1) + bytes([REEL, 4])
COMPACT_SEGMENT = Section.SEGMENT, SEGMENT[:-1] + bytes([64 + 4])

REFUSED: dict[str, Callable[[], bytes]] = {
    "cosines_with_adaptive_times": with_adaptive_cosines,
    "cosines_with_rests": partial(with_cosines, 3, ((1, 2),)),
    "cosines_of_1025_frames": partial(with_cosines, 1025, ()),
    "long_name": with_long_name,
    "rate_above_the_limit": with_high_rate,
    "triangles_apart": with_triangles_apart,
    "start_twice": partial(with_section, 1, START, START),
    "times_twice": partial(with_section, 1, TIMES, TIMES),
    "times_and_start": partial(with_section, 1, TIMES, START),
    "times_in_a_block": partial(with_section, 2, TIMES),
    "block_behind_times": partial(with_section, 4, TIMES, 1, 2, 3),
    "times_before_and_behind_blocks": partial(with_section, 1, TIMES, 1, 2, 3, TIMES, n_replaced=3),
    **{
        f"times_{reason}": partial(with_section, 1, (Section.TIMES, numbers), of=three_frames)
        for reason, numbers in {
            "none": b"",
            "descending": doubles(1, 0, 2),
            "equal": doubles(0, 1, 1),
            "infinite": doubles(0, 1, np.inf),
            "without_number": doubles(0, np.nan, 2),
            "too_far_apart": doubles(-1.7e308, 0, 1.7e308),
            "predicted_too_early": doubles(0) + write_varint(1) + doubles(2),
            "predicted_infinite": doubles(0, 1.7e308) + write_varint(1),
            "cut": doubles(0, 1) + bytes(5),
            "fewer": doubles(0, 1),
            "more": doubles(0, 1, 2, 3),
        }.items()
    },
    "cells_with_polygons": partial(
        cells_and, (Section.POLYGONS, write_varint(66) + encode_integers([np.ones(66, int)]))
    ),
    "cells_with_connectivity": partial(cells_and, (Section.CONNECTIVITY, b"")),
    "cells_twice": lambda: cells_and(0),
    **{
        f"cells_with_an_order_{reason}": partial(cells_and, (Section.ORDER, order), n_replaced=1)
        for reason, order in {
            "of_faces": b"\2",
            "with_a_zero_byte": b"\3\1\0",
            "with_more_bytes": b"\3" + bytes(200) + b"\1",
        }.items()
    },
    **{
        f"cells_{kind}{reason}": partial(with_cells, counts, kind == "")
        for kind in ("", "walked_")
        for reason, counts in {
            "none": (0, 288, 66),
            "fewer_nodes": (36, 287, 66),
            "more_nodes": (36, 289, 66),
            "fewer_nodes_than_cells": (36, 35, 66),
            "fewer_faces": (36, 288, 65),
            "more_faces": (36, 288, 67),
            "more_faces_than_triangles": (36, 288, 133),
        }.items()
    },
    **{
        f"cells_{kind}_of_a_missing_node": partial(
            with_cells, (36, 288, 66), kind == "listed", second_node=80
        )
        for kind in ("listed", "walked")
    },
    "cells_without_order": partial(cells_and, n_replaced=1),
    "cells_with_a_dropped_order": partial(
        with_section, 1, (Section.ORDER, b""), of=STREAMS["cells_dropped"]
    ),
    "cells_of_no_bits": partial(cells_and_payload, write_varints(36, 288, 66)),
    "cells_with_a_zero_byte": lambda: cells_and_payload(cells_payload() + b"\0"),
    "cells_with_more_bytes": lambda: cells_and_payload(cells_payload() + b"\0\0\0\0\0\0\0\1"),
    **{
        f"attribute_{reason}": partial(with_attribute, *numbers)
        for reason, numbers in {
            "predicted_from_points": (Section.ATTRIBUTE, 0, 3, 4),
            "from_points_along_faces": (Section.ATTRIBUTE_FROM_POINTS, 0, 3, 2),
            "from_points_of_faces": (Section.ATTRIBUTE_FROM_POINTS, 1, 1, 4),
        }.items()
    },
    "track_of_no_cells": lambda: with_section(1, (Section.TRACK, write_track(OF_NO_CELLS))),
    **{
        f"track_with_{reason}": partial(heated, **changes)
        for reason, changes in {
            "negative_bound": {"bound": -1.0},
            "infinite_bound": {"bound": np.inf},
            "scale_zero": {"scale": 0.0},
            "infinite_origin": {"origin": (np.inf,)},
            **{
                f"{kind}_of_{width}_numbers": {"kind": kind, "origin": (0.0,) * width}
                for kind, width in {
                    "vector": 4,
                    "velocity": 2,
                    "normal": 2,
                    "color": 5,
                    "uv": 3,
                    "scalar": 2,
                }.items()
            },
        }.items()
    },
    "track_with_more_bytes": lambda: with_section(
        1, (Section.TRACK, write_track(HEAT) + b"\0"), n_replaced=1, of=heated
    ),
    "tracks_of_one_name": partial(heated, 2),
    "block_without_a_track": partial(with_section, 6, n_replaced=4, of=heated),
    "block_with_two_groups_of_a_track": partial(with_section, 10, 6, 7, 8, 9, of=heated),
    "relation_to_the_positions": partial(with_relations, 2),
    "relations_in_a_long_chain": partial(with_relations, *[1] * 9),
    "relation_to_other_items": partial(with_relations, 1, domain=Domain.FACE),
    "nugget_of_positions": partial(with_nugget, 13, of_positions=True),
    "start_in_a_block": partial(with_section, 2, START),
    "missing_of_positions": partial(with_section, 2, (Section.MISSING, b"")),
    "grid_beside_modes_of_positions": partial(with_section, 5, ON_GRID, of=heated),
    "grid_beside_modes_of_a_track": partial(with_section, 9, ON_GRID, n_replaced=1, of=heated),
    **{
        f"grid_of_a_track_in_form_{payload[0]}": partial(
            *(with_section, 6, (Section.TRACK_BLOCK, b"\0"), (Section.VALUES, payload)),
            n_replaced=4,
            of=heated,
        )
        for payload in (bytes(24), b"\2" + ON_GRID[1][1:], b"\t" + ON_GRID[1][1:])
    },
    "basis_after_coefficients": partial(with_section, 3, 4, 3, n_replaced=2),
    "rounding_longer_than_the_mesh": partial(
        *(with_section, 3, (Section.ROUNDING, write_varints(211, 0, 0) + NO_ROUNDING[3:])),
        of=STREAMS["lossless_rounded"],
        n_replaced=1,
    ),
    "rounding_of_modes": partial(with_section, 2, (Section.ROUNDING, NO_ROUNDING)),
    "grid_whose_second_frame_is_extrapolated": partial(
        with_section, 3, EXTRAPOLATED, of=STREAMS["grid_of_all_kinds"], n_replaced=1
    ),
    "rounding_of_an_unknown_form": partial(
        *(with_section, 3, (Section.ROUNDING, NO_ROUNDING), (Section.VALUES, bytes([3]) * 24)),
        of=STREAMS["lossless_rounded"],
        n_replaced=2,
    ),
    "rounding_without_grid": partial(
        *(with_section, 3, (Section.ROUNDING, NO_ROUNDING), (Section.VALUES, bytes(24))),
        of=STREAMS["lossless_rounded"],
        n_replaced=2,
    ),
    "compact_of_1025_bytes": lambda: compact_and(bare(0xF0, bytes(1025 - len(compact_and()) - 3))),
    "segment_that_is_compact": partial(with_section, 4, COMPACT_SEGMENT, 0, 1, 2, 3),
    "compact_with_a_wrong_checksum": lambda: compact_and()[:-1] + b"\0",
    **{
        f"error_bound_{reason}": partial(with_error_bound, payload)
        for reason, payload in {
            "short": bytes(7),
            "long": np.float64(1.0).tobytes() + b"\0",
            "zero": np.float64(0.0).tobytes(),
            "negative": np.float64(-1.0).tobytes(),
            "infinite": np.float64(np.inf).tobytes(),
            "no_number": np.float64(np.nan).tobytes(),
            "decimal_zero": b"\1\0",
        }.items()
    },
    **{
        f"exact_with_a_bound_{reason}": partial(of_lossy_and, coding, bound)
        for reason, coding, bound in (
            ("of_zero", 17, 0.0),
            ("not_finite", 17, np.inf),
            ("of_modes", 16, 1.0),
        )
    },
    **{
        f"rests_{reason}": partial(with_rests, numbers)
        for reason, numbers in {
            "first_time": [0, 1, 0, 1],
            "no_time": [0, 1, 1, 0],
            "behind_the_block": [0, 1, 1, 2],
            "no_run": [0, 0],
            "of_9_bits": [9, 1, 1, 1],
        }.items()
    },
}
"""Streams that break one rule of the page: every reader must refuse them."""


def main():
    """Write missing streams."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--force", action="store_true", help="replace existing files")
    parser.add_argument("names", nargs="*", help="streams; default: all")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - {*STREAMS, *segments.STREAMS}:
        parser.error(f"unknown streams: {', '.join(sorted(unknown))}")
    write_refused(REFUSED, REFUSED_FOLDER, arguments.force)
    write_refused(segments.REFUSED, segments.REFUSED_FOLDER, arguments.force)
    write_streams(STREAMS, FOLDER, arguments)
    write_streams(segments.STREAMS, segments.FOLDER, arguments)


def made(name, make):
    """Return a stream; only those named compact are compact."""
    size = MAX_COMPACT if name.startswith("compact") else 0
    with patch.object(stream_container, "MAX_COMPACT", size):
        return make()


def write_refused(streams, folder, replace_existing):
    """Write missing streams, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in streams.items():
        path = folder / f"{name}.reel"
        if not path.exists() or replace_existing:
            path.write_bytes(made(name, make))


def write_streams(streams, folder, arguments):
    """Write the selected missing streams and their descriptions."""
    folder.mkdir(exist_ok=True)
    for name in streams:
        path = folder / f"{name}.reel"
        is_selected = not arguments.names or name in arguments.names
        if not is_selected or (path.exists() and not arguments.force):
            continue
        data = made(name, streams[name])
        path.write_bytes(data)
        description = json.dumps(describe_all(read_all(data)), indent=1, ensure_ascii=False)
        path.with_suffix(".json").write_text(description + "\n", "utf-8")
        print(f"{name}: {len(data)} bytes")


if __name__ == "__main__":
    main()
