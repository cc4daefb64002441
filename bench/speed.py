"""Seconds of encoding and decoding, relative to Draco and to lower bounds of the work.

    python bench/speed.py --all --data FOLDER --out speed.json     # everything, some 15 minutes
    python bench/speed.py samba.npz cow.npz --efforts 1,5,9
    python bench/speed.py --subdivided horse_gallop.npz --sphere 6 100 --memory --serial
    python bench/speed.py --growth frames
    python bench/speed.py            # the embedded flag

Draco codes every frame independently. The floors are the minimal work of a modal encoder or
decoder: a Gram matrix and one projection for each axis; the product of basis and coefficients for
each axis, and writing the frames. The paper's serial decoding solves a system for each frame. All
others are timed in alternating rounds; tables list medians without the first round.
"""

import argparse
import json
import os
from pathlib import Path
from typing import Any

from meshreel.evaluation.runs.timing import machine_facts
from speed_bounds import MAX_EXPONENT, Verdict, verdicts_on, verdicts_on_growth
from speed_cases import Plan, measure
from speed_coders import DEFAULT_EFFORT, OwnMethod, coders_of, reel_coder
from speed_growth import growth
from speed_inputs import Source, add_inputs, sources, standard_sources
from speed_tables import case_report, growth_report, machine_text, summary
from speed_timing import Patience, threads_text


def numbers(text: str) -> list[int]:
    """Parse comma-separated integers."""
    return [int(part) for part in text.split(",")]


def parse_options() -> argparse.Namespace:
    """Parse the command line and expand `--all`."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    add_inputs(parser)
    parser.add_argument("--all", action="store_true", help="samba, horse_gallop subdivided, a "
                        "large sphere and a long flag; also growth, memory and the serial method; "
                        "reel only at effort 5 by default")  # fmt: skip
    parser.add_argument("--data", type=Path, default=os.environ.get("MESHREEL_DATA"),
                        help="folder of samba.npz and horse_gallop.npz for --all; default: "
                        "$MESHREEL_DATA")  # fmt: skip
    parser.add_argument("--efforts", type=numbers, help="of reel; default 1,5,9")
    parser.add_argument("--modes", type=int, default=20, help="of the floors and of pca-qp, pca-qs")
    parser.add_argument("--without-paper", action="store_true", help="skip pca-qp")
    parser.add_argument("--repeats", type=int, default=5, help="maximum rounds per case")
    parser.add_argument("--seconds", type=float, default=60.0,
                        help="time limit per case, after at least three rounds")  # fmt: skip
    parser.add_argument("--memory", action="store_true", help="also measure peak memory")
    parser.add_argument("--serial", action="store_true", help="also time pca-qs")
    parser.add_argument("--growth", action="append", choices=list(MAX_EXPONENT), default=[],
                        help="fit the growth of seconds; alone, nothing else")  # fmt: skip
    parser.add_argument("--out", type=Path, help="write the figures here as JSON")
    options = parser.parse_args()
    if options.all:
        if options.data is None:
            parser.error("--all needs --data FOLDER, or the variable MESHREEL_DATA")
        options.memory = options.serial = options.without_paper = True
        options.growth = list(MAX_EXPONENT)
    options.efforts = options.efforts or ([DEFAULT_EFFORT] if options.all else [1, 5, 9])
    return options


def plan_of(options: argparse.Namespace) -> Plan:
    """The measurements of every sequence."""
    coders = coders_of(options.efforts, options.modes, with_paper=not options.without_paper)
    patience = Patience(options.repeats, options.seconds)
    return Plan(coders, options.modes, patience, options.serial, options.memory)


def cases_of(options: argparse.Namespace) -> list[Source]:
    """The requested sequences; none if only `--growth` is requested."""
    if options.all:
        return standard_sources(options.data)
    has_inputs = options.inputs or options.subdivided or options.flag or options.sphere
    return sources(options) if has_inputs or not options.growth else []


def summary_coder(options: argparse.Namespace) -> OwnMethod:
    """The coder of the summary and of growth."""
    effort = DEFAULT_EFFORT if DEFAULT_EFFORT in options.efforts else options.efforts[0]
    return reel_coder(effort)


def main() -> None:
    """Measure as requested; print tables, and write JSON if requested."""
    options = parse_options()
    plan, coder = plan_of(options), summary_coder(options)
    about: dict[str, Any] = {
        "machine": machine_facts(),
        "threads": threads_text(),
        "n_modes_of_floor": options.modes,
        "coders": [repr(coder) for coder in plan.coders],
    }
    print(f"# Speed\n\n{machine_text(about)}\n", flush=True)
    results: list[dict[str, Any]] = []
    growths: list[dict[str, Any]] = []
    verdicts: list[Verdict] = []
    for source in cases_of(options):
        results.append(measure(source(), plan))
        verdicts += verdicts_on(results[-1])
        print(case_report(results[-1]), flush=True)
    for of in options.growth:
        growths.append(growth(of, coder, plan.patience))
        verdicts += verdicts_on_growth(growths[-1])
        print(growth_report(growths[-1]), flush=True)
    print(summary(results, verdicts, coder.name), flush=True)
    if options.out:
        judged = [verdict.as_dict() for verdict in verdicts]
        figures = {**about, "results": results, "growth": growths, "verdicts": judged}
        options.out.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
