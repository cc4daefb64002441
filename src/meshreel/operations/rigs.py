"""Sizes of other files of the same animation, to compare a rig with."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import MeshReelError
from meshreel.formats.options import WriteOptions
from meshreel.formats.save import save_part
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource

GLTF = (".glb", ".gltf")


def sizes_of_alternatives(
    sequence: "AnySource",
    frames: range,
    output: Path,
    options: WriteOptions,
    rig: dict[str, Any],
    progress: Progress,
) -> dict[str, int]:
    """Return the bytes of the same frames as morph targets and as a .reel, by name.

    Morph targets have the error bound of the rig, and are for glTF outputs; a .reel has its KG
    bound. What does not meet the bound, or cannot be written, has no entry: nobody asked for it.

    Parameters
    ----------
    rig : dict of str to any
        Figures of the written rig.
    """
    sizes = {}
    bounds = rig["bounds_percent"]
    if output.suffix.lower() in GLTF:
        bound = bounds["largest"] if options.max_error is None else options.max_error
        morphs = replace(options, rig=None, kg=None, quality=None, max_error=bound)
        with TemporaryDirectory() as folder, suppress(MeshReelError, OSError, MemoryError):
            path = Path(folder) / output.name
            save_part(sequence, frames, path, options=morphs, progress=progress)
            sizes["morph targets"] = path.stat().st_size
    if isinstance(sequence, ReelFile):
        if len(frames) == sequence.n_frames:
            sizes[".reel (input)"] = sequence.size_bytes
    elif options.origin is None:
        with suppress(MeshReelError, MemoryError):
            data = encode(sequence.part(frames), kg=bounds["kg"], progress=progress)
            sizes[".reel"] = len(data)
    return sizes
