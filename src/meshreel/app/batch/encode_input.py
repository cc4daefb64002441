"""Encoding of one input by a worker."""

import math
import sys
import time
from dataclasses import dataclass, field, replace
from typing import Any

from meshreel.app.batch.manifest import MEASURED
from meshreel.codec.config import EncoderConfig
from meshreel.codec.decoder import decode
from meshreel.codec.reel_options import quality_of
from meshreel.codec.surface.uv_grid import has_uvs
from meshreel.errors import InvalidInputError, Keyword, Message, WorkerDiedError
from meshreel.formats.frames.selection import with_surfaces
from meshreel.formats.load import open_for_encoding
from meshreel.formats.options import Reading
from meshreel.formats.remote import local_copy
from meshreel.formats.supported_options import supported_only
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence, positions_size_bytes, tracks_of_all
from meshreel.model.surface_selection import ALL, describe_missing, missing_everywhere, select
from meshreel.model.tracks import max_items
from meshreel.operations.encoding import encode_and_measure
from meshreel.operations.registering import register_frames
from meshreel.registration.options import RegisterOptions
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import silent
from meshreel.runtime.version import __version__

BLOCK_SHARES = (1.0, 1 / 4, 1 / 16)
"""Fractions of the frames of a block to try in order if memory runs out."""

READ_OPTIONS = ("fps", "merge", "attributes", "skip_bad", "allow_outside")
"""Fields of `Reading` that the manifest records if they differ from the default."""


@dataclass(frozen=True)
class EncodeOptions:
    """Options for every input of a batch."""

    config: EncoderConfig
    reading: Reading = field(default_factory=Reading)
    """Options that do not apply to the format of an input are ignored; an input without a selected
    attribute gets a note.
    """
    registering: RegisterOptions | None = None
    """Registers inputs whose faces change."""
    tracks: dict[str, float | str] | None = None
    """Error bounds of tracks. An input without one of them gets a note."""
    block_share: float = 1.0
    """Fraction of the config's frames per block; below 1 after memory ran out. Positions are then
    read from their files on demand, with a note.
    """

    def smaller(self, error: BaseException) -> "EncodeOptions | None":
        """The options with smaller blocks after an error; None if that cannot help.

        Replacing a dead worker takes long, so the smallest blocks are next.
        """
        smaller = BLOCK_SHARES[BLOCK_SHARES.index(self.block_share) + 1 :]
        is_death = worker_died(error)
        if not smaller or not (is_death or isinstance(error, MemoryError)):
            return None
        return replace(self, block_share=smaller[-1 if is_death else 0])

    def as_dict(self) -> dict[str, Any]:
        """Options that differ from the default, in plain types."""
        options = {option.name: getattr(self.config, option.name) for option in self.config.chosen}
        reading = {name: getattr(self.reading, name) for name in READ_OPTIONS}
        options |= {
            name: value for name, value in reading.items() if value != getattr(Reading, name)
        }
        if self.registering is not None:
            options["register"] = self.registering.bound.plain
            names = "keep_holes", "keep_debris"
            options |= {name: True for name in names if getattr(self.registering, name)}
        return {**options, "tracks": self.tracks} if self.tracks else options


def worker_died(error: BaseException) -> bool:
    """Whether a call failed because a worker died, a process of this machine or of Dask."""
    dask = sys.modules.get("distributed")
    return isinstance(error, (WorkerDiedError, *([dask.KilledWorker] if dask else [])))


@dataclass(frozen=True)
class EncodedInput:
    """A stream and its measurements."""

    data: bytes
    figures: dict[str, Any]
    """The fields of a `Record` that encoding determines."""


def encode_input(source: str, options: EncodeOptions, version: str) -> EncodedInput:
    """Encode and measure the sequence at a path or an address.

    Writes no files: a stopped worker leaves nothing behind, and a remote worker needs access only
    to the inputs.

    Raises
    ------
    InvalidInputError
        If the version of meshreel differs from the caller's.
    """
    if version != __version__:
        raise InvalidInputError(
            f"the worker has meshreel {__version__} and the caller {version}; install the same"
        )
    began = time.perf_counter()
    notes = Notes()
    registering, registered = options.registering, None
    reading = replace(
        supported_only(options.reading, source),
        attributes=ALL,
        notes=notes,
        matches_frames=options.config.order in (None, "drop") and registering is None,
    )
    with local_copy(source) as files:
        # After memory ran out, frames are read on demand.
        memory_bytes = options.config.memory_bytes if options.block_share == 1 else 0.0
        opened = open_for_encoding(files, memory_bytes, reading)
        if registering is not None and opened.n_segments > 1:
            registering = replace(registering, quality=quality_of(options.config))
            registered = register_frames(opened, registering, notes, silent)
            opened = registered.sequence
            notes += registered.registration.notes()
        elif registering is not None:
            notes.result("not registered: all frames have the same faces")
        sequence, config = _apply_options(opened, options, notes)
        if registered is not None:
            config = registered.tuned(config, notes)
        bounds, tracks = options.tracks or {}, tracks_of_all(sequence)
        if missing := [name for name in bounds if name not in tracks]:
            notes.changed(f"has no track {', '.join(missing)}")
        bounds = {name: bound for name, bound in bounds.items() if name in tracks}
        encoded = encode_and_measure(sequence, config, bounds, notes)
        if registered is not None:
            notes += registered.report(decode(encoded.data), silent).notes()
    figures = encoded.as_dict()
    figures["tracks"] = {
        name: {key: errors[key] for key in ("largest", "rms", "unit")}
        for name, errors in figures["tracks"].items()
    }
    measured = {name: _finite(figures.get(name)) for name in MEASURED}
    seconds = round(time.perf_counter() - began, 3)
    return EncodedInput(encoded.data, {"seconds": seconds, **measured, "notes": notes})


def _apply_options(
    source: MeshSequence, options: EncodeOptions, notes: Notes
) -> tuple[MeshSequence, EncoderConfig]:
    """The input with its selected attributes, and the options that apply to it."""
    config, names = options.config, options.reading.attributes
    surfaces = [segment.surface for segment in source.segments]
    if missing := missing_everywhere(surfaces, names):
        notes.changed(describe_missing(surfaces[0], missing))
    sequence = with_surfaces(
        source, [select(surface, names, ignore_missing=True) for surface in surfaces]
    )
    if config.uv_bits is not None and not any(
        has_uvs(segment.surface) for segment in sequence.segments
    ):
        notes.changed(
            Message("has no texture coordinates for ", Keyword("uv_bits"), " to quantize")
        )
        config = replace(config, uv_bits=None)
    if (config.images or config.max_image) and not any(
        segment.surface.images for segment in sequence.segments
    ):
        option = Keyword("images" if config.images else "max_image")
        notes.changed(Message("has no images of materials for ", option))
        config = replace(config, images=None, max_image=None)
    if options.block_share < 1:
        largest = max(sequence.segments, key=positions_size_bytes)
        sizes = max_items(largest.n_verts, largest.tracks.values()), largest.dtype.itemsize
        block_frames = config.frames_in_block(largest.n_frames, *sizes)
        n_frames = max(1, int(options.block_share * block_frames))
        notes.result(
            f"workers ran out of memory or died with blocks of {counted(block_frames, 'frame')}; "
            f"coded in blocks of {n_frames}, which take more bytes"
        )
        config = config.with_blocks_of(n_frames, *sizes)
    return sequence, config


def _finite(value: Any) -> Any:
    """Figures for JSON, which are None if they are not finite."""
    if isinstance(value, dict):
        return {name: _finite(figure) for name, figure in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
