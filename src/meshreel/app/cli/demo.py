"""`meshreel demo`: encode, decode and compare the simulated flag."""

from pathlib import Path
from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_json, print_table, shown_progress
from meshreel.app.cli.messages import print_line
from meshreel.app.cli.parameters import JsonOption
from meshreel.app.figures import quality_rows, size_rows
from meshreel.codec.option import Option

N_POSES = 3
"""Number of frames in the picture, including the one with the largest error."""


@command
def demo_command(
    out: Annotated[
        Path, Option("Folder for the results; created if missing.", flag="--out -o")
    ] = Path("meshreel-demo"),
    frames: Annotated[int, Option("Number of frames, 1 or more.")] = 300,
    force: Annotated[bool, Option("Replace results of an earlier run.", flag="--force -f")] = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate a flag, compress and decompress it, and show the error.

    Writes flag.npz (the original), flag.reel, flag.html (a page that plays it, in any browser and
    offline) and, if the extra [render] is installed, flag.png (original and decoded side by side).

    Example:

    - `meshreel demo --frames 100 --out /tmp/flag`
    """
    from meshreel.app.cli.player import open_player
    from meshreel.app.viewer.export import export_page
    from meshreel.app.viewer.page import built_page
    from meshreel.codec.decoder import decode
    from meshreel.codec.encoder import encode
    from meshreel.codec.inspect import info
    from meshreel.formats.options import Reading
    from meshreel.metrics.compare import compare
    from meshreel.model.flag import simulate_flag
    from meshreel.operations.encoding import size_figures
    from meshreel.operations.save import save
    from meshreel.rendering.scenes import Scene
    from meshreel.runtime.extras import RENDER
    from meshreel.runtime.outputs.checks import check_output_folder, check_output_path

    check_output_folder(out)
    out.mkdir(parents=True, exist_ok=True)
    raw, reel, page, picture = (out / f"flag.{kind}" for kind in ("npz", "reel", "html", "png"))
    outputs = {"original": raw, "stream": reel, "page": page}
    if RENDER.is_installed:
        outputs["picture"] = picture
    for path in outputs.values():
        check_output_path(path, overwrite=force)
    with shown_progress() as progress:
        sequence = simulate_flag(frames, progress=progress)
        save(sequence, raw, overwrite=force, progress=progress)
        data = encode(sequence, progress=progress)
        save(data, reel, overwrite=force)
        with open_player(reel, None, Reading(progress=progress)) as player:
            export_page(player, page, page=built_page(), overwrite=force, progress=progress)
        decoded, stream = decode(data, progress=progress), info(data)
        quality = compare(sequence, decoded, progress=progress)
        scene = Scene(decoded, sequence, "distance")
        largest = scene.scales(range(frames), progress).heat
        assert largest is not None  # the scene has a heat map
        poses: list[int] = []
        if RENDER.is_installed:
            from meshreel.rendering.shots import representative_frames
            from meshreel.rendering.stills import save_png, still
            from meshreel.rendering.views import View

            caption = (
                f"{stream.ratio:.0f} x smaller, {stream.rate_bpvf:.2f} bits per vertex and frame, "
                f"KG error {quality.kg_error_percent:.2f} %"
            )
            # Some frames, among them the one with the largest error.
            some = representative_frames(range(scene.sequence.n_frames), N_POSES - 1)
            poses = sorted({*some, largest.frame})
            image = still(scene, poses, View(), caption=caption, progress=progress)
            save_png(image, picture, overwrite=force)
    paths = {name: str(path) for name, path in outputs.items()}
    if as_json:
        worst = {"max_error_frame": largest.frame, "picture_frames": poses}
        print_json({**paths, **size_figures(stream), **quality.as_dict(), **worst})
        return
    rows = {**size_rows(stream), **quality_rows(quality)}
    rows["largest error"] += f", in frame {largest.frame}"
    print_table("The flag, compressed", rows)
    print_table("Written", {"picture": f"not drawn; {RENDER.command}", **paths})
    print_line(f"To play it, open {page}; to compare it with the original:")
    print_line(f"meshreel view {reel} --original {raw}")
