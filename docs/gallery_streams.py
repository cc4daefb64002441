"""Animations that the site plays, made by the scripts of examples/ when the site is built."""

import os
import runpy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import meshreel
from meshreel.runtime.counting import size_text

SHARE = 1 / int(os.environ.get("MESHREEL_DRAFT", "1"))
"""Share of the frames, for checks of the pages alone."""
EXAMPLES = Path(__file__).parents[1] / "examples"


@dataclass(frozen=True)
class Shown:
    """An animation, and how the site shows it.

    Attributes
    ----------
    data : bytes
    figures : str
        A sentence with its sizes and errors, as Markdown.
    attributes : str
        Attributes of its element.
    extension : str
    element : str
        "reel-player", or "three-figure" for files drawn by three.js.
    """

    data: bytes
    figures: str
    attributes: str
    extension: str = ".reel"
    element: str = "reel-player"


@cache
def gallery() -> dict[str, Shown]:
    """All animations of the site, by the names of their files."""
    return {name: make() for name, make in MAKERS.items()}


def _flag() -> Shown:
    flag = meshreel.simulate_flag(round(150 * SHARE))
    data = meshreel.encode(flag)
    return Shown(data, _figures(flag, data), 'alt="A flag in the wind"')


def _fish() -> Shown:
    fish = _example("character_for_web")["fish"]()
    data = meshreel.encode(fish)
    return Shown(data, _figures(fish, data), 'alt="A fish swims" camera-orbit="-35deg 75deg 105%"')


def _raw_walk() -> Shown:
    raw = _capture()
    data = meshreel.encode(raw)
    text = (
        f"{raw.n_frames} frames, each with its own mesh: {size_text(raw.raw_size_bytes)} became "
        f"{size_text(len(data))}"
    )
    return Shown(data, text, 'alt="A walking figure, as captured" camera-orbit="40deg 80deg 105%"')


def _walk() -> Shown:
    raw = _capture()
    registered = meshreel.register(raw, tolerance="0.5%")
    data = meshreel.encode(registered)
    errors = meshreel.compare(raw[:1], meshreel.decode(data)[:1], surface=True)
    text = (
        f"{raw.n_frames} frames with one mesh: {size_text(len(data))}; the mean distance from the "
        f"captured surface is {errors.to_original.mean_percent:.2g} % of the diagonal"
    )
    return Shown(data, text, 'alt="A walking figure, registered" camera-orbit="40deg 80deg 105%"')


def _plate() -> Shown:
    plate = _example("archive_simulation")["simulate"](round(75 * SHARE))
    bounds = {"temperature": "0.5K", "heat flow": "0.1%", "phase": "exact"}
    data = meshreel.encode(plate, max_error="0.01%", tracks=bounds)
    attributes = (
        'alt="A plate is heated" camera-orbit="30deg 50deg 105%" track="temperature" '
        'track-range="293:600"'
    )
    return Shown(data, _figures(plate, data), attributes)


def _in_three(extension: str, **options: Any) -> Callable[[], Shown]:
    """A fish within a bound, as a file that three.js draws."""

    def make() -> Shown:
        fish = _example("character_for_web")["fish"]()
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"fish{extension}"
            meshreel.save(fish, path, max_error="0.5%", **options)
            data, errors = path.read_bytes(), meshreel.compare(fish, meshreel.load(path))
        text = (
            f"{size_text(len(data))}; the largest error is {errors.max_error_percent:.2g} % of the "
            f"diagonal, normals are off by {errors.normal_angle_mean_deg:.2g} degrees"
        )
        return Shown(data, text, 'alt="A fish swims"', extension, "three-figure")

    return make


MAKERS: dict[str, Callable[[], Shown]] = {
    "flag": _flag,
    "fish": _fish,
    "raw_walk": _raw_walk,
    "walk": _walk,
    "plate": _plate,
    "fish_stream": _in_three(".reel"),
    "fish_rig": _in_three(".glb", rig=True, meshopt=True),
    "fish_morphs": _in_three(".glb", rig=0, meshopt=True),
}


@cache
def _capture() -> meshreel.MeshSequence:
    captured: meshreel.MeshSequence = _example("register_capture")["capture"](round(25 * SHARE))
    return captured


def _example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


def _figures(original: meshreel.MeshSequence, data: bytes) -> str:
    error = meshreel.compare(original, data).max_error_percent
    return (
        f"{original.n_frames} frames, {original.n_verts} vertices: "
        f"{size_text(original.raw_size_bytes)} became {size_text(len(data))}; the largest error "
        f"of a vertex is {error:.2g} % of the diagonal"
    )
