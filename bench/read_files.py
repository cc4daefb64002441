"""Contents of all files under a folder as readers find them: frames, vertices, faces, notes.

python bench/read_files.py FOLDER
"""

import argparse
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from meshreel.errors import MeshReelError
from meshreel.formats.load import load
from meshreel.formats.registry import FORMATS


def read(path: Path) -> tuple[str, ...]:
    """Frames, vertices and faces of a file, and its notes or its error."""
    notes: list[str] = []
    try:
        found = load(path, merge=True, notes=notes)
    except MeshReelError as error:
        return ("-", "-", "-", f"refused: {error}".replace(f"{path}: ", "").replace(f"{path} ", ""))
    counts = (found.n_frames, found.n_verts, found.n_faces)
    return (*map(str, counts), "\n".join(notes))


def main() -> None:
    """Print a row for each file that is read or refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    table = Table("file", "frames", "vertices", "faces", "notes")
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.suffix.lower() in FORMATS:
            table.add_row(str(path.relative_to(folder)), *map(escape, read(path)))
    Console(width=None).print(table)


if __name__ == "__main__":
    main()
