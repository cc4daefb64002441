"""Archive a folder of sequences within an error bound, verify each, and write a table.

    python examples/archive.py captures/ archive/ --max-error 0.1

Every file or folder of frames in the first folder becomes a `.reel` in the second. Each stream is
decoded and compared with its original before it is written; `archive.csv` lists sizes and errors.
"""

import argparse
import csv
from pathlib import Path

import meshreel

COLUMNS = ("name", "frames", "vertices", "raw_bytes", "bytes", "bound_percent", "error_percent")


def archive(source: Path, out: Path, max_error: float) -> dict[str, object]:
    """Write the verified stream of a sequence, and return its row of the table."""
    sequence = meshreel.load(source)
    data = meshreel.encode(sequence, max_error=max_error)
    error = meshreel.compare(sequence, data).max_error_percent
    bound = meshreel.info(data).max_error_percent
    if bound is None or error > bound:
        raise SystemExit(f"{source}: the largest error is {error} %, the bound {bound} %")
    (out / f"{source.stem}.reel").write_bytes(data)
    sizes = (sequence.raw_size_bytes, len(data))
    shape = (source.stem, sequence.n_frames, sequence.n_verts)
    row = (*shape, *sizes, bound, round(error, 6))
    return dict(zip(COLUMNS, row, strict=True))


def main() -> None:
    """Archive all sequences of a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sources", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--max-error", type=float, default=0.1, help="percent of the diagonal")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    sources = sorted(path for path in arguments.sources.iterdir() if path.suffix != ".reel")
    rows = [archive(source, arguments.out, arguments.max_error) for source in sources]
    with (arguments.out / "archive.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        table.writerows(rows)
    for row in rows:
        print(f"{row['name']}: {row['bytes']} bytes, largest error {row['error_percent']} %")


if __name__ == "__main__":
    main()
