"""Compress all clips that a game tool exports as OBJ files, and write them for an engine.

    python examples/obj_folders.py --out streams/
    python examples/obj_folders.py clips/ --fps 30 --max-error 1mm --unit m --out streams/

Every folder of frames becomes a `.reel` file within the bound, on all cores, and a `.glb` file with
morph targets for Unity, Unreal or three.js. Run it again to encode only clips that are new, have
changed or failed. Without clips, it exports two flags.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import meshreel


def export_clips(folder: Path, fps: float) -> None:
    """Write two clips, a folder of OBJ files for each."""
    for name, n_rows in (("banner", 24), ("pennant", 12)):
        if not (folder / name).exists():
            flag = meshreel.simulate_flag(48, n_rows=n_rows, n_columns=36, fps=fps)
            meshreel.save(flag, folder / name / "frame_%04d.obj")


def main() -> None:
    """Encode the clips, list them, and write the files for the engine."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clips", nargs="?", type=Path, help="a folder with a folder for each clip")
    parser.add_argument("--fps", type=float, default=30.0, help="OBJ files have none")
    parser.add_argument("--max-error", default="0.1%", help="of the diagonal, or a length")
    parser.add_argument("--unit", help="of the clips, if the bound is a length")
    parser.add_argument("--out", type=Path, required=True, help="a folder")
    arguments = parser.parse_args()
    clips = arguments.clips
    if clips is None:
        clips = arguments.out / "clips"
        export_clips(clips, arguments.fps)

    streams = arguments.out / "streams"
    options = ["--max-error", arguments.max_error, "--fps", str(arguments.fps)]
    if arguments.unit:
        options += ["--unit", arguments.unit]
    batch = [sys.executable, "-m", "meshreel", "batch", clips, streams, *options]
    result = subprocess.run(batch, check=False)  # 1 if some clips failed

    for name, record in json.loads((streams / "manifest.json").read_text())["inputs"].items():
        if record["state"] != "done":
            print(f"{name}: {record['error']}")
            continue
        reel = streams / record["output"]
        print(f"{name}: {record['ratio']:.0f} times smaller, {record['size_bytes'] / 1e3:.1f} kB")
        notes: list[str] = []
        glb = reel.with_suffix(".glb")
        with meshreel.open(reel) as clip:
            meshreel.save(clip, glb, overwrite=True, notes=notes)
        print(f"    {glb.name}: {glb.stat().st_size / 1e3:.0f} kB", *notes, sep="\n    ")
    sys.exit(result.returncode)


if __name__ == "__main__":
    main()
