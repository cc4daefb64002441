"""Figures of a written rig, compared with morph targets and a .reel of the same frames."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from meshreel.errors import MeshReelError
from meshreel.runtime.counting import counted, size_text

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource, WriteOptions
    from meshreel.model.sequence import MeshSequence
    from meshreel.runtime.progress import Progress

GLTF = (".glb", ".gltf")


def size_as_morph_targets(
    sequence: "AnySource",
    frames: range,
    output: Path,
    options: "WriteOptions",
    rig: dict[str, Any],
    progress: "Progress",
) -> dict[str, int]:
    """Return the size of a glTF output with morph targets and the error bound of the rig.

    Empty for other formats, and if morph targets do not meet the bound. `rig` has the figures of
    the rig.
    """
    from meshreel.formats.save import save_part

    if output.suffix.lower() not in GLTF:
        return {}
    bound = rig["bounds_percent"]["largest"] if options.max_error is None else options.max_error
    without_rig = replace(options, rig=None, kg=None, quality=None, max_error=bound)
    # Nobody requested morph targets: that they cannot meet the bound is no error.
    with TemporaryDirectory() as folder, suppress(MeshReelError):
        path = Path(folder) / output.name
        save_part(sequence, frames, path, options=without_rig, progress=progress)
        return {"morph targets": path.stat().st_size}
    return {}


def size_as_stream(
    sequence: "MeshSequence", rig: dict[str, Any], progress: "Progress"
) -> dict[str, int]:
    """Return the bytes of a .reel with the KG bound of a rig, given the figures of the rig.

    Empty if no stream meets it.
    """
    from meshreel.codec.encoder import encode

    with suppress(MeshReelError):
        return {".reel": len(encode(sequence, kg=rig["bounds_percent"]["kg"], progress=progress))}
    return {}


def rig_rows(figures: dict[str, Any]) -> dict[str, str]:
    """Return rows of a table with the errors of a rig, its parts, and the alternatives."""
    rig = figures["rig"]
    rows = {
        "rig": f"{counted(rig['n_bones'], 'bone')}, "
        f"{counted(rig['n_targets'], 'corrective target')}",
        "KG error": f"{rig['kg_percent']:.3g} %",
        "largest error": f"{rig['largest_percent']:.3g} % of the diagonal",
        "normal error": f"{rig['normal_deg']:.2g} degrees (mean, of faces)",
    }
    sizes = figures.get("sizes_bytes", {}).items()
    alternatives = figures["alternatives_bytes"].items()
    rows |= {f"  {name}": size_text(size) for name, size in sizes}
    return rows | {f"as {name}": size_text(size) for name, size in alternatives}
