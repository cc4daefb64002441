"""The law of promises: random sequences through every door keep what is requested and stated.

`PYTHONPATH=tests python -m law.test_law --seconds 3600 --first 0` looks for broken promises, and
prints the simplest choices that break each.
"""

import argparse
import json
import random
import tempfile
import time
import traceback
import warnings
from pathlib import Path

import pytest

from law.doors import DOORS
from law.sequences import choose, made, simpler
from meshreel import MeshReelError
from samples.costs import draws

pytestmark = pytest.mark.filterwarnings("ignore:bounds include the error of the source")

REFUSALS = (
    "no error bound allows", "cannot be guaranteed", "cannot be met", "whose order would be lost",
    "give them the same fps", "the faces change", "need the order of cells",
    "leaves nothing for morph targets",
)  # fmt: skip
"""Reasons for which a person accepts that nothing is written."""

FOUND = (
    ("commands", 0), ("encode", 37), ("encode", 163), ("encode", 680), ("encoded_again", 201350),
    ("formats", 95), ("formats", 197), ("formats", 540), ("limits", 50), ("limits", 203511),
)  # fmt: skip
"""Doors and seeds that broke a promise once."""

BY_NAME = {door.__name__: door for door in DOORS}


def attempt(door, choice, folder):
    """Send the sequence of some choices through a door; refusals for a good reason are fine."""
    try:
        BY_NAME[door](made(choice), random.Random(choice["seed"]), folder)
    except MeshReelError as error:
        if not any(reason in str(error) for reason in REFUSALS):
            raise


@pytest.mark.every_case
@pytest.mark.parametrize("first", range(0, 160, 40))
@pytest.mark.parametrize("door", BY_NAME)
def test_promises_hold(door, first, tmp_path):
    for seed in range(first, first + draws(40)):
        choice, folder = choose(seed), tmp_path / str(seed)
        folder.mkdir()
        try:
            attempt(door, choice, folder)
        except Exception as error:
            error.add_note(f"door {door}, {json.dumps(choice)}")
            raise


@pytest.mark.every_case
@pytest.mark.parametrize(("door", "seed"), FOUND)
def test_mended_faults_stay_mended(door, seed, tmp_path):
    attempt(door, choose(seed), tmp_path)


def fault_of(door, choice):
    """Return where a promise breaks, and the traceback; or None."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(action="ignore"):
        try:
            attempt(door, choice, Path(folder))
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            text = str(error).replace(folder, "").partition(":")[2][:40]
            place = door, type(error), frame.lineno, "".join(c for c in text if not c.isdigit())
            return place, traceback.format_exc(limit=-3)
    return None


def search(seconds, first):
    """Print the simplest choices of each new fault, for some seconds."""
    end, seen, seed = time.monotonic() + seconds, set(), first
    while time.monotonic() < end:
        seed += 1
        door, choice = random.Random(seed).choice([*BY_NAME]), choose(seed)
        fault = fault_of(door, choice)
        if fault is None or fault[0] in seen:
            continue
        seen.add(fault[0])
        candidates = simpler(choice)
        while (candidate := next(candidates, None)) is not None:
            again = fault_of(door, candidate)
            if again is not None and again[0] == fault[0]:
                choice, candidates = candidate, simpler(candidate)
        print(fault[1], door, json.dumps(choice), sep="\n", flush=True)
    print(f"{seed - first} sequences, {len(seen)} faults")
    return len(seen)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    raise SystemExit(min(search(arguments.seconds, arguments.first), 1))
