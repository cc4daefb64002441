"""Ablation study of `reel`: Bjontegaard rates with one part of the method changed.

    python bench/ablations.py samba.npz cow.npz --out ablations.json

Every stream is encoded, decoded and compared; rates are those of whole files without vertex order.
Positive numbers are an increase of the rate at equal KG error, and at equal STED.
"""

import argparse
import dataclasses
import json
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import meshreel
import meshreel.codec.reel.encoding.basis_coding as basis_coding
import meshreel.codec.reel.encoding.effort as effort
from measuring import print_table
from meshreel.codec.reel.encoding.block_coder import FieldBlockCoder
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.fields import CodingOrder, coding_order
from meshreel.kernel.mesh import Hierarchy
from meshreel.studies.rate_distortion import bd_rate

QUALITIES = (30, 45, 60, 75)
CODE = FieldBlockCoder.code
HIERARCHY: Any = vars(FieldMesh)["hierarchy"].func


def choices(**changed: Any) -> Any:
    """Patch choices of the encoder."""
    usual = effort.choices_for
    return lambda: patch.object(
        effort, "choices_for", lambda *a: dataclasses.replace(usual(*a), **changed)
    )


def constant(module: Any, name: str, value: Any) -> Any:
    """Patch a constant or a function, in encoder and decoder."""
    return lambda: patch.object(module, name, value)


def code_alone(coder: FieldBlockCoder, frames: Any, *_: Any) -> Any:
    """Code a block independently of the others."""
    return CODE(coder, frames)


def no_smooth_fields(mesh: FieldMesh) -> Hierarchy:
    """A hierarchy whose smooth fields are constant: first weights depend on distance alone."""
    usual: Hierarchy = HIERARCHY(mesh)
    return dataclasses.replace(usual, smooth=np.zeros_like(usual.smooth))


def one_pass(mesh: FieldMesh) -> CodingOrder:
    """All vertices in coding order, in one pass, without context neighbors."""
    none = np.empty((mesh.n_verts, 0), np.int32)
    return coding_order(none, np.array([0, mesh.n_verts]))


VARIANTS: dict[str, list[Any]] = {
    "unchanged": [],
    "weights follow no modes": [choices(n_learned=0)],
    "weights follow 12 modes": [choices(n_learned=12)],
    "weights follow all modes": [choices(n_learned=255)],
    "stencils of 8": [choices(stencil_size=8)],
    "stencils of 12": [choices(stencil_size=12)],
    "no smooth fields: first weights by distance": [
        constant(FieldMesh, "hierarchy", property(no_smooth_fields))
    ],
    "rounding to the nearest": [choices(rate_weight=0.0)],
    "no noise shaping": [choices(feedback_gain=0.0)],
    "noise shaping on all resolutions": [choices(n_shaped_resolutions=99)],
    "one pass without context neighbors": [constant(FieldMesh, "coding_order", property(one_pass))],
    "basis step 2 times that of the fields": [choices(basis_step=2.0)],
    "basis step 5 times that of the fields": [choices(basis_step=5.0)],
    "modes kept from 0.4 steps": [choices(least_rms=0.4)],
    "modes kept from 1 step": [choices(least_rms=1.0)],
    "no cosines over time": [constant(basis_coding, "MIN_COSINE_GAIN", 1.0)],
    "cosines over time wherever nothing rests": [
        constant(basis_coding, "MIN_COSINE_GAIN", -math.inf)
    ],
    "no adaptive times": [constant(basis_coding, "MIN_ADAPTIVE_GAIN", 1.0)],
    "adaptive times in place of all others": [
        constant(basis_coding, "MIN_ADAPTIVE_GAIN", -math.inf)
    ],
    **{
        f"effort {number}": [choices(**vars(spent))]
        for number, spent in effort.EFFORTS.items()
        if number in (1, 3, 7, 9)
    },
    "tune geometry": [
        choices(basis_step=2.5, least_rms=0.5, feedback_gain=0.5, n_shaped_resolutions=1)
    ],
    "blocks of 50 frames": [],
    "blocks of 25 frames": [],
    "blocks of 12 frames": [],
    "blocks of 50 frames, independent": [constant(FieldBlockCoder, "code", code_alone)],
    "blocks of 12 frames, independent": [constant(FieldBlockCoder, "code", code_alone)],
}


@contextmanager
def changed(name: str) -> Iterator[None]:
    """Apply the changes of a variant."""
    with ExitStack() as stack:
        for change in VARIANTS[name]:
            stack.enter_context(change())
        yield


def curve(source: str, variant: str) -> list[tuple[float, float, float]]:
    """Rate, KG error and STED of a variant at each quality."""
    sequence = meshreel.load(source)
    is_cut = variant.startswith("blocks")
    options: dict[str, Any] = {"block_frames": int(variant.split()[2])} if is_cut else {}
    points = []
    with changed(variant):
        for quality in QUALITIES:
            data = meshreel.encode(sequence, quality=quality, order="vertices", **options)
            quality_hat = meshreel.compare(sequence, meshreel.decode(data))
            size = len(data) - meshreel.info(data).budget_bytes["order"]
            rate = 8.0 * size / (sequence.n_verts * sequence.n_frames)
            points.append((rate, quality_hat.kg_error_percent, quality_hat.sted))
    return points


def difference(usual: list[Any], other: list[Any], column: int) -> float:
    """BD-rate in percent at equal error."""
    reference, changed_curve = (
        [(point[0], point[column]) for point in points] for points in (usual, other)
    )
    return float(bd_rate(changed_curve, reference).percent or 0.0)


def main() -> None:
    """Measure and print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sources", nargs="+")
    parser.add_argument("--out", type=Path, help="JSON with every point")
    parser.add_argument("--only", help="variants whose names contain this text")
    arguments = parser.parse_args()
    names = [
        name
        for name in VARIANTS
        if name == "unchanged" or not arguments.only or arguments.only in name
    ]
    jobs = [(source, name) for name in names for source in arguments.sources]
    with ProcessPoolExecutor() as pool:
        curves = dict(zip(jobs, pool.map(curve, *zip(*jobs, strict=True)), strict=True))
    titles = [Path(source).stem for source in arguments.sources]
    rows = []
    for name in names[1:]:
        cells = [name]
        for source in arguments.sources:
            change = partial(difference, curves[source, "unchanged"], curves[source, name])
            cells.append(f"{change(1):+.1f}, {change(2):+.1f}")
        rows.append(cells)
    print_table("", ["KG, STED", *titles], rows)
    if arguments.out:
        points = [
            {"source": Path(source).stem, "variant": variant, "points": points}
            for (source, variant), points in curves.items()
        ]
        arguments.out.write_text(json.dumps(points, indent=1))


if __name__ == "__main__":
    main()
