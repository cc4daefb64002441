"""Export evaluated meshes of a range of frames to a `.reel` file, in steps that can be canceled."""

import os
import tempfile
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import bpy
import numpy as np

import meshreel
from meshreel.model.notes import Notes

from .axes import matrix_to_file
from .open_reels import release
from .scene_reading import SceneReading
from .timeline import scene_rate

FRAMES_SHARE = 0.8
"""Fraction of the progress for evaluating the frames."""

POLL_S = 0.05


class _CanceledError(Exception):
    """Raised in the encoding thread when the export was canceled."""


@dataclass(frozen=True)
class ExportChoices:
    """Frames to export, and export options.

    Parameters
    ----------
    frames : range
        Scene frames; at least one.
    up : {"Y", "Z"}
        Up axis of the file.
    target : dict
        The target of `meshreel.encode`, such as ``{"quality": 80}``.
    """

    frames: range
    up: str
    target: dict[str, float]


def export_reel(
    context: Any, objects: Sequence[Any], path: Path, choices: ExportChoices, notes: Notes
) -> Generator[float, None, None]:
    """Write the objects as parts of one file; yields the progress, 0..1.

    The file appears whole, at the end, in place of an earlier one. Closing the generator gives the
    work up. Until all are there, frames are kept in a temporary file: they are coded together.

    Parameters
    ----------
    context : bpy.types.Context
        The scene steps through the frames and is restored at the end.
    objects : sequence of bpy.types.Object
        Objects with a surface; at least one.
    path : Path
    choices : ExportChoices
    notes : Notes
        Receives a sentence for everything that the file cannot store.

    Raises
    ------
    ExportError
        If there are no faces, or those of an object change.
    MeshReelError
        If the frames cannot be coded.
    OSError
        If there is no space for the frames, or the file cannot be written.
    """
    with tempfile.TemporaryFile(dir=bpy.app.tempdir or None) as spool:
        reading = yield from _evaluate(context, objects, choices, spool, notes)
        frames: Any = np.memmap(spool, np.float32, "r").reshape(len(choices.frames), -1, 3)
        rate = scene_rate(context.scene.render.fps, context.scene.render.fps_base)
        sequence = meshreel.MeshSequence(
            frames,
            reading.faces,
            fps=rate / choices.frames.step,
            name=objects[0].name if len(objects) == 1 else path.stem,
            start_s=choices.frames.start / rate,
            surface=reading.surface,
        )
        data = yield from _encode(sequence, choices.target)
    release(path)
    _write_whole(path, data)


def _evaluate(
    context: Any, objects: Sequence[Any], choices: ExportChoices, spool: IO[bytes], notes: Notes
) -> Generator[float, None, SceneReading]:
    """Write the positions of every frame into a file; gives the reading, with faces and surface."""
    scene = context.scene
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        scene.frame_set(choices.frames.start)
        reading = SceneReading(objects, context, matrix_to_file(choices.up), notes)
        for number, scene_frame in enumerate(choices.frames):
            scene.frame_set(scene_frame)
            spool.write(reading.positions().tobytes())
            yield FRAMES_SHARE * (number + 1) / len(choices.frames)
        spool.flush()
    finally:
        scene.frame_set(frame, subframe=subframe)
    return reading


def _encode(
    sequence: meshreel.MeshSequence, target: dict[str, float]
) -> Generator[float, None, bytes]:
    """The bytes of a stream, coded in a thread, so that whoever waits can give up."""
    done, is_given_up = 0.0, threading.Event()

    def progress(stage: str, fraction: float) -> None:
        nonlocal done
        done = max(done, fraction)
        if is_given_up.is_set():
            raise _CanceledError

    with ThreadPoolExecutor(1, "meshreel-export") as pool:
        future = pool.submit(meshreel.encode, sequence, progress=progress, **target)  # type: ignore[arg-type]
        try:
            yield FRAMES_SHARE
            while wait([future], POLL_S).not_done:
                yield FRAMES_SHARE + (1 - FRAMES_SHARE) * done
        finally:
            is_given_up.set()
        return future.result()


def _write_whole(path: Path, data: bytes) -> None:
    temporary = path.with_name(f".{path.name}.part")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
