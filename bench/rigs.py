"""Rigs of sequences beside morph targets and `.reel`: errors as read back, and bytes by part.

    python bench/rigs.py dance.npz horse_gallop.npz
    python bench/rigs.py samba.npz --kg 0.7 --bones 48

The morph targets have the same bound of the largest error, and the `.reel` that of the KG error.
Normals are left out of both GLB files.
"""

import argparse
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import meshreel
from measuring import machine_text, print_table
from meshreel.studies.timing import timed_once

HEADER = [
    "sequence",
    "KG %",
    "largest %",
    "normals deg",
    "kB",
    "processor s",
    "morphs kB",
    ".reel kB",
]


def row_of(path: Path, folder: Path, args: argparse.Namespace) -> tuple[list[str], list[str]]:
    """The row of a sequence, and the notes on its rig."""
    sequence, notes = meshreel.load(path), list[str]()
    folder = folder / path.stem
    folder.mkdir()
    rigged, morphed = folder / "rig.glb", folder / "morphs.glb"
    save = partial(meshreel.save, sequence, max_error=args.max_error, normals=False)
    _, seconds = timed_once(partial(save, rigged, notes=notes, rig=args.bones or True, kg=args.kg))
    quality = meshreel.compare(sequence, meshreel.load(rigged))
    # Files leave out vertices that no face uses; then only surfaces can be compared.
    is_same = isinstance(quality, meshreel.Quality)
    save(morphed)
    stream = meshreel.encode(sequence, kg=args.kg)
    row = [
        path.stem,
        f"{quality.kg_error_percent:.3f}" if is_same else "-",
        f"{quality.max_error_percent:.3f}" if is_same else "-",
        f"{quality.normal_angle_mean_deg:.1f}" if is_same else "-",
        f"{rigged.stat().st_size / 1e3:.0f}",
        f"{seconds.processor:.0f}",
        f"{morphed.stat().st_size / 1e3:.0f}",
        f"{len(stream) / 1e3:.0f}",
    ]
    return row, [note for note in notes if note.startswith("the rig") or " kB: " in note]


def main() -> None:
    """Print a row per sequence, then the parts of each rig."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--kg", type=float, default=0.5)
    parser.add_argument("--max-error", type=float, default=1.0)
    parser.add_argument("--bones", type=int)
    args = parser.parse_args()
    print(machine_text())
    with TemporaryDirectory() as folder:
        results = [row_of(path, Path(folder), args) for path in args.sequences]
    print_table("", HEADER, [row for row, _ in results])
    for (name, *_), notes in results:
        print(f"{name}: {'; '.join(notes)}")


if __name__ == "__main__":
    main()
