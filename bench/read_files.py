"""List frames, vertices, faces and notes of all mesh files in a folder.

python bench/read_files.py FOLDER
"""

import argparse
from pathlib import Path

from meshreel.app.cli.console import print_columns
from meshreel.errors import MeshReelError
from meshreel.formats.load import load
from meshreel.formats.registry import FORMATS


def read(path: Path) -> tuple[str, ...]:
    """Frames, vertices and faces of a file, and its notes or its error."""
    notes: list[str] = []
    try:
        sequence = load(path, merge=True, notes=notes)
    except MeshReelError as error:
        return ("-", "-", "-", f"error: {error}".replace(f"{path}: ", "").replace(f"{path} ", ""))
    counts = (sequence.n_frames, sequence.n_verts, sequence.n_faces)
    return (*map(str, counts), "; ".join(notes))


def main() -> None:
    """Print a row for each file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    rows = [
        (str(path.relative_to(folder)), *read(path))
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix.lower() in FORMATS
    ]
    print_columns(str(folder), ("file", "frames", "vertices", "faces", "notes"), rows)


if __name__ == "__main__":
    main()
