"""Visual errors, distances and file sizes by quality.

    python bench/qualities.py samba.npz cow.npz --qualities 60,80,100 --out qualities.json

Prints a Markdown table with visual errors (mean angle between face normals in degrees, and STED),
RMS and largest distance of vertices from their originals in percent of the diagonal of the bounding
box of all frames, and the ratio of raw float32 positions to the file size with default options.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import meshreel
from measuring import print_table


def measure(source: str, quality: float) -> dict[str, Any]:
    """Measure a sequence at a quality."""
    sequence = meshreel.simulate_flag(100) if source == "flag" else meshreel.load(source)
    data = meshreel.encode(sequence, quality=quality)
    errors = meshreel.compare(sequence, meshreel.decode(data))
    return {
        "source": Path(source).stem,
        "quality": quality,
        "ratio": 12.0 * sequence.n_frames * sequence.n_verts / len(data),
        "angle_deg": errors.normal_angle_mean_deg,
        "sted": errors.sted,
        "rms_percent": errors.rms_error_percent,
        "max_percent": errors.max_error_percent,
    }


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+", help="files; flag is the embedded one")
    parser.add_argument("--qualities", default="60,80,100")
    parser.add_argument("--out", type=Path, help="JSON with every figure")
    parser.add_argument("--workers", type=int)
    arguments = parser.parse_args()
    qualities = [float(text) for text in arguments.qualities.split(",")]
    jobs = [(source, quality) for source in arguments.sources for quality in qualities]
    with ProcessPoolExecutor(arguments.workers) as pool:
        results = list(pool.map(measure, *zip(*jobs, strict=True)))
    rows: dict[str, list[str]] = {}
    for result in results:
        rows.setdefault(result["source"], [result["source"]]).append(
            f"{result['angle_deg']:.2g}, {result['sted']:.2g}; {result['rms_percent']:.2g}, "
            f"{result['max_percent']:.2g}; {result['ratio']:.0f}"
        )
    header = ["degrees, STED; RMS, largest %; ratio", *(f"{quality:g}" for quality in qualities)]
    print_table("", header, rows.values())
    if arguments.out:
        arguments.out.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
