"""Print sizes and errors of a sequence over a range of qualities.

    python examples/rate_distortion.py walk.npz --qualities 60,70,80,90

Without a sequence it uses the simulated flag.
"""

import argparse

import meshreel

HEAD = f"{'quality':>8} {'kB':>8} {'bpvf':>7} {'KG %':>8} {'STED':>8} {'largest %':>10}"


def row(sequence: meshreel.MeshSequence, quality: float) -> str:
    """Return the row of the table for a quality."""
    data = meshreel.encode(sequence, quality=quality)
    errors = meshreel.compare(sequence, data)
    rate = meshreel.info(data).rate_bpvf
    figures = f"{errors.kg_error_percent:8.3f} {errors.sted:8.4f} {errors.max_error_percent:10.3f}"
    return f"{quality:8g} {len(data) / 1000:8.1f} {rate:7.3f} {figures}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequence", nargs="?")
    parser.add_argument("--qualities", default="40,50,60,70,80")
    arguments = parser.parse_args()
    path = arguments.sequence
    sequence = meshreel.load(path) if path else meshreel.simulate_flag(100)
    print(sequence, HEAD, sep="\n")
    for quality in arguments.qualities.split(","):
        print(row(sequence, float(quality)))


if __name__ == "__main__":
    main()
