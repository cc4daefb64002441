"""What qualities mean: to the eye, to the tape measure, and in bytes.

    python bench/qualities.py samba.npz cow.npz --qualities 60,80,100 --out qualities.json

Prints a Markdown table. To the eye: the mean angle between normals of faces in degrees, and STED.
To the tape measure: distances of vertices from their originals, the root mean square and the
largest, in percent of the diagonal of the bounding box of all frames. In bytes: raw float32
positions by the size of the file as the defaults write it.
"""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import meshreel


def measured(source: str, quality: float) -> dict[str, Any]:
    """Figures of a sequence at a quality."""
    sequence = meshreel.simulate_flag(100) if source == "flag" else meshreel.load(source)
    data = meshreel.encode(sequence, quality=quality)
    lost = meshreel.compare(sequence, meshreel.decode(data))
    return {
        "source": Path(source).stem,
        "quality": quality,
        "ratio": 12.0 * sequence.n_frames * sequence.n_verts / len(data),
        "angle_deg": lost.normal_angle_mean_deg,
        "sted": lost.sted,
        "rms_percent": lost.rms_error_percent,
        "max_percent": lost.max_error_percent,
    }


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", nargs="+", help="files; flag is the embedded one")
    parser.add_argument("--qualities", default="60,80,100")
    parser.add_argument("--out", type=Path, help="JSON with every figure")
    parser.add_argument("--workers", type=int)
    arguments = parser.parse_args()
    qualities = [float(one) for one in arguments.qualities.split(",")]
    jobs = [(source, quality) for source in arguments.sources for quality in qualities]
    with ProcessPoolExecutor(arguments.workers) as pool:
        found = list(pool.map(measured, *zip(*jobs, strict=True)))
    print(
        "| degrees, STED; RMS, largest %; ratio | " + " | ".join(f"{q:g}" for q in qualities) + " |"
    )
    print("|---|" + "---|" * len(qualities))
    for source in arguments.sources:
        cells = [
            f"{row['angle_deg']:.2g}, {row['sted']:.2g}; "
            f"{row['rms_percent']:.2g}, {row['max_percent']:.2g}; {row['ratio']:.0f}"
            for row in found
            if row["source"] == Path(source).stem
        ]
        print(f"| {Path(source).stem} | " + " | ".join(cells) + " |")
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
