"""Error bounds of positions, of tracks and of both."""

import pickle
import warnings
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import meshreel
from meshreel.codec.error_bounds import ErrorBound, bound_of
from meshreel.codec.options import config_of
from meshreel.codec.track_bounds import (
    DROP,
    EXACT,
    Measure,
    TrackBound,
    bound_of_track,
    default_bound,
    kept_bounds,
    without_units,
)
from meshreel.errors import InvalidInputError
from meshreel.metrics.track_errors import track_errors
from meshreel.model.notes import Notes
from meshreel.model.tracks import Track
from samples.meshes import waving_grid


@pytest.mark.parametrize(
    ("given", "diagonal", "bound", "percent"),
    [
        *((given, 7, ErrorBound(0.1), 0.1) for given in (0.1, "0.1", "0.1%", " .1 % ", "1e-1")),
        ("0.5u", 10, ErrorBound(0.5, is_length=True), 5),
        ("0.5 U", 10, ErrorBound(0.5, is_length=True), 5),
        ("3e-7u", 1, ErrorBound(3e-7, is_length=True), 3e-5),
    ],
)
def test_bounds_are_percent_of_the_diagonal_or_model_units(given, diagonal, bound, percent):
    assert bound_of(given) == bound_of(bound.plain) == bound
    assert bound.percent(diagonal) == pytest.approx(percent, rel=1e-15)
    assert bound.share(diagonal) == pytest.approx(percent / 100, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "unit", "in_units"),
    [
        ("0.5mm", "mm", 0.5),
        ("0.5mm", "cm", 0.05),
        ("2cm", "m", 0.02),
        ("1in", "cm", 2.54),
        ("1ft", "in", 12.0),
        ("1ft", "mm", 304.8),
        ("2m", "km", 0.002),
        ("1km", "m", 1000.0),
    ],
)
def test_length_is_converted_for_a_model_with_a_known_unit(given, unit, in_units):
    bound = bound_of(given, unit)
    assert bound.is_length
    assert bound.amount == pytest.approx(in_units, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "unit", "message"),
    [
        ("0.5mm", None, "has no length unit.* unit .*or use model units"),
        ("0.5mm", "px", "unit is one of mm, cm, m, km, in, ft; got 'px'"),
        ("0.5px", None, "has no unit 'px'"),
        ("small", None, "takes percent of the diagonal"),
        ("", None, "takes percent of the diagonal"),
        ("0", None, "above 0"),
        ("-1", None, "takes percent"),
        (float("nan"), None, "above 0"),
        (float("inf"), None, "above 0"),
        ("1e999", None, "above 0"),
        ("0.1%", "mm", "unit has no effect on 0.1%"),
        ("0.5u", "mm", "unit has no effect on 0.5u"),
        (0.1, "mm", "unit has no effect on 0.1"),
    ],
)
def test_ambiguous_bound_is_refused(given, unit, message):
    with pytest.raises(InvalidInputError, match=message):
        bound_of(given, unit)


GRID = waving_grid(9)
HEAT = 40.0 * GRID.vertices[..., 2]
NORMALS = np.random.default_rng(4).normal(size=GRID.vertices.shape)
NORMALS /= np.linalg.norm(NORMALS, axis=2, keepdims=True)
TRACKS = {
    "heat": Track(HEAT, unit="K"),
    "up": Track(NORMALS, kind="normal"),
    "state": Track((HEAT > 0).astype(np.uint8)),
}
SEQUENCE = GRID.replace(tracks=TRACKS)
PERCENT = 0.5
HEAT_BOUND = PERCENT / 100 * np.ptp(HEAT)
ANGLE_DEG = np.degrees(2 * np.arcsin(PERCENT / 100))


@pytest.mark.parametrize(
    ("tracks", "heat"), [(None, HEAT_BOUND), ({"heat": "400mK"}, 0.4)], ids=["all", "but one"]
)
def test_bound_is_that_of_positions_and_of_tracks_without_another(tracks, heat):
    data = meshreel.encode(SEQUENCE, bound=f"{PERCENT}%", tracks=tracks)
    assert data == meshreel.encode(SEQUENCE, bound=PERCENT, tracks=tracks)
    assert meshreel.info(data).error_bound_percent == pytest.approx(PERCENT)
    bounds = {track.name: track.bound for track in meshreel.info(data).tracks}
    assert bounds == {"heat": pytest.approx(heat), "up": pytest.approx(ANGLE_DEG), "state": 0}
    assert 0.5 * heat < meshreel.compare(SEQUENCE, data).tracks["heat"].largest <= heat


def test_one_frame_on_a_grid_is_within_the_bound():
    rounded = np.round(GRID.vertices[:1] * 64) / 64
    frame = meshreel.MeshSequence(rounded, GRID.faces, tracks={"heat": Track(HEAT[:1], unit="K")})
    data = meshreel.encode(frame, bound=PERCENT)
    errors = meshreel.compare(frame, data)
    assert errors.max_error_percent <= PERCENT
    assert errors.tracks["heat"].largest <= PERCENT / 100 * np.ptp(HEAT[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"bound": "1mm"}, "^bound is a percentage such as 0.1%.*got '1mm'.*with max_error"),
        ({"bound": 0}, "^bound must be above 0, in percent; got 0"),
        ({"bound": "0.1%", "max_error": 1}, "^bound and max_error exclude each other"),
        ({"bound": "0.1%", "size": 100}, "^bound and size exclude each other"),
        ({"bound": "0.1%", "lossless": True}, "^bound has no effect with lossless"),
        ({"bound": "0.1%", "method": "pca-qp"}, "^method pca-qp does not take bound"),
    ],
)
def test_bound_that_has_no_meaning_is_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        meshreel.encode(SEQUENCE, **options)


PRESSURE = Track(np.zeros((1, 2)), unit="Pa")
PLAIN = Track(np.zeros((1, 2)))
FLOW = Track(np.zeros((1, 2, 3)), kind="velocity", unit="m/s")
NORMAL = Track(np.zeros((1, 2, 3)), kind="normal")
COLOR = Track(np.zeros((1, 2, 3)), kind="color")
UV = Track(np.zeros((1, 2, 2)), kind="uv")
COUNTS = Track(np.zeros((1, 2), np.int32))


@pytest.mark.parametrize(
    ("track", "given", "measure", "amount"),
    [
        (PRESSURE, 500, Measure.UNITS, 500),
        (PRESSURE, "=5e2", Measure.UNITS, 500),
        (PRESSURE, " .5 Pa ", Measure.UNITS, 0.5),
        (PRESSURE, "0.1%", Measure.SHARE, 0.1),
        (PRESSURE, "2MPa", Measure.UNITS, 2e6),
        (PRESSURE, "3 N/mm^2", Measure.UNITS, 3e6),
        (FLOW, "4mm/s", Measure.UNITS, 0.004),
        (UV, "0.001", Measure.UNITS, 0.001),
        (NORMAL, "0.5deg", Measure.ANGLE, 0.5),
        (NORMAL, "30 deg", Measure.ANGLE, 30),
        (COLOR, "8bit", Measure.NUMBER, 0.5 / 255),
        (COLOR, "1bit", Measure.NUMBER, 0.5),
        (COLOR, "10 bit", Measure.NUMBER, 0.5 / 1023),
        (COLOR, "52bit", Measure.NUMBER, 0.5 / (2**52 - 1)),
        (COLOR, "2%", Measure.SHARE, 2),
    ],
)
def test_bounds_are_parsed(track, given, measure, amount):
    result = bound_of_track(given, "x", track)
    assert result == TrackBound(measure, pytest.approx(amount, rel=1e-15))


@pytest.mark.parametrize("track", [PRESSURE, NORMAL, COUNTS])
@pytest.mark.parametrize(("given", "bound"), [("exact", EXACT), ("Drop ", DROP)])
def test_any_track_can_be_exact_or_dropped(track, given, bound):
    assert bound_of_track(given, "x", track) == bound


IN_PASCALS = "500Pa in its unit or one that converts to it, exact or drop"


@pytest.mark.parametrize(
    ("track", "given", "message"),
    [
        *((PRESSURE, given, f"{IN_PASCALS}; got '{given}'") for given in ("500K", "much", "-1")),
        *((PRESSURE, given, f"0.1% of its range, {IN_PASCALS}") for given in ("0.5deg", "8bit")),
        *((PRESSURE, given, "must be above 0") for given in ("0", "1e999")),
        (PLAIN, "500Pa", r"a number such as 500 \(the track has no unit\), exact or drop"),
        *(
            (COLOR, given, f"take 1bit to 52bit, or exact; got '{given}'")
            for given in ("0.9bit", "53bit", "2000bit", "1e-30bit")
        ),
        (COLOR, "0.5deg", r"\(the track has no unit\), 8bit, exact or drop"),
        *(
            (NORMAL, given, "is an angle such as 0.5deg, exact or drop")
            for given in ("0.1%", "0.1")
        ),
        (NORMAL, "30.1deg", "at most 30deg; got '30.1deg'"),
        (COUNTS, "1%", "has integers, which are lossless"),
    ],
)
def test_bound_that_does_not_suit_the_track_is_refused(track, given, message):
    with pytest.raises(InvalidInputError, match=f"track 'x'.*{message}"):
        bound_of_track(given, "x", track)


@pytest.mark.parametrize(
    ("track", "options", "bound", "origin"),
    [
        (PRESSURE, {"max_error": 1}, TrackBound(Measure.SHARE, 0.1), "0.1 %, default"),
        (NORMAL, {"kg": 1}, TrackBound(Measure.ANGLE, 0.5), "default"),
        (COLOR, {"step": 0.1}, TrackBound(Measure.NUMBER, 0.5 / 255), "default"),
        (UV, {"max_error": 1}, TrackBound(Measure.UNITS, 0.5 / 4096), "default"),
        (PRESSURE, {}, TrackBound(Measure.SHARE, 0.2), "0.2 %, quality 80"),
        (PRESSURE, {"size": "1kB"}, TrackBound(Measure.SHARE, 0.2), "0.2 %, quality 80"),
        (FLOW, {"quality": 92}, TrackBound(Measure.SHARE, 0.5), "0.5 %, quality 92"),
        (NORMAL, {"quality": 68}, TrackBound(Measure.ANGLE, 2.0), "quality 68"),
        (NORMAL, {"quality": 10}, TrackBound(Measure.ANGLE, 30.0), "quality 10"),
        (COLOR, {"quality": 68}, TrackBound(Measure.NUMBER, 1.0 / 255), "quality 68"),
        (UV, {"quality": 92}, TrackBound(Measure.UNITS, 0.25 / 4096), "quality 92"),
        (COUNTS, {"quality": 20}, EXACT, "integers"),
        (Track(np.zeros((1, 2, 3), np.uint8), kind="color"), {}, EXACT, "integers"),
        (PRESSURE, {"lossless": True}, EXACT, "lossless"),
        (PRESSURE, {"bound": 0.2}, TrackBound(Measure.SHARE, 0.2), "0.2 %, bound"),
        (COLOR, {"bound": 0.2}, TrackBound(Measure.SHARE, 0.2), "0.2 %, bound"),
        (NORMAL, {"bound": 0.2}, TrackBound(Measure.ANGLE, 0.229183), "bound"),
        (NORMAL, {"bound": 400}, TrackBound(Measure.ANGLE, 30.0), "bound"),
        (COUNTS, {"bound": 0.2}, EXACT, "integers"),
    ],
)
def test_default_bound_follows_the_target_and_the_kind(track, options, bound, origin):
    result = default_bound(track, config_of(**options))
    assert (result.measure, result.origin) == (bound.measure, origin)
    assert result.amount == pytest.approx(bound.amount, rel=1e-5)


def test_bounds_are_the_requested_ones_or_the_default():
    tracks, config = {"a": PRESSURE, "b": NORMAL, "c": COUNTS}, config_of()
    result = kept_bounds(config, tracks, {"a": "2Pa"})
    assert result == {
        "a": TrackBound(Measure.UNITS, 2.0),
        "b": TrackBound(Measure.ANGLE, 1.0),
        "c": EXACT,
    }
    assert (result["a"].origin, result["b"].origin) == ("tracks", "quality 80")
    assert list(kept_bounds(config, tracks, {"b": "drop"})) == ["a", "c"]
    with pytest.raises(InvalidInputError, match="there is no track 'd'"):
        kept_bounds(config, tracks, {"d": "exact"})


@pytest.mark.parametrize(
    ("track", "given", "expected"),
    [
        (PLAIN, "500Pa", "500"),
        (PLAIN, "=.5 m/s", ".5"),
        (PRESSURE, "500K", "500K"),
        (PLAIN, "0.1%", "0.1%"),
        (PLAIN, "8bit", "8bit"),
        (PLAIN, "0.5deg", "0.5deg"),
        (COLOR, "500Pa", "500Pa"),
        (PLAIN, "drop", "drop"),
        (NORMAL, "0.5rad", "0.5rad"),
        (PLAIN, 500, 500),
    ],
)
def test_unit_of_a_bound_is_omitted_with_a_note_for_tracks_without_units(track, given, expected):
    notes = Notes()
    assert without_units({"x": track}, {"x": given, "y": "1Pa"}, notes)["x"] == expected
    note = f"track 'x' has no unit in the file; its bound {given} is read as {expected}"
    assert notes == ([note] if given != expected else [])


@pytest.fixture(scope="module")
def lossy(tmp_path_factory):
    """A stream within `PERCENT` in a file."""
    path = tmp_path_factory.mktemp("lossy") / "a.reel"
    path.write_bytes(meshreel.encode(SEQUENCE, bound=PERCENT))
    return path


def saved(sequence, **options):
    """Encode a sequence, or an open file, by `save`."""
    with TemporaryDirectory() as folder, ExitStack() as stack:
        if isinstance(sequence, Path):
            sequence = stack.enter_context(meshreel.open(sequence))
        notes, path = [], Path(folder) / "b.reel"
        meshreel.save(sequence, path, notes=notes, **options)
        warnings.warn("; ".join(notes), stacklevel=1)
        return path.read_bytes()


def part_of_file(path):
    with meshreel.open(path) as reel:
        return reel[2:9]


SOURCES = {
    "path": lambda path: path,
    "bytes": lambda path: path.read_bytes(),
    "decoded": lambda path: meshreel.decode(path),
    "loaded": meshreel.load,
    "part": lambda path: meshreel.load(path)[2:9],
    "part of a file": part_of_file,
    "replaced": lambda path: meshreel.load(path).replace(fps=12, name="b"),
    "segments": lambda path: SEQUENCE[:2] + meshreel.load(path)[2:].replace(start_s=2 / 25),
    "pickled": lambda path: pickle.loads(pickle.dumps(meshreel.load(path))),
}
AGAIN = {
    "bound": (2, {"bound": PERCENT}, meshreel.encode),
    "grid": (2, {"max_error": PERCENT, "method": "grid"}, meshreel.encode),
    "lossless": (1, {"lossless": True}, meshreel.encode),
    "saved": (2, {"max_error": PERCENT}, saved),
    "saved losslessly": (1, {"lossless": True}, saved),
    "quality": (None, {"quality": 30}, meshreel.encode),
}


@pytest.mark.parametrize(
    ("source", "again"),
    [(source, "bound") for source in SOURCES]
    + [(source, again) for source in ("path", "decoded") for again in AGAIN if again != "bound"],
)
def test_bounds_of_a_lossy_source_are_added(lossy, source, again):
    factor, options, encode = AGAIN[again]
    named = "positions.*track heat" if factor else "track heat"
    with pytest.warns(match=f"bounds include the error of the source.*: {named}"):
        data = encode(SOURCES[source](lossy), **options)
    info, decoded = meshreel.info(data), meshreel.decode(data)
    original = SEQUENCE[2:9] if source.startswith("part") else SEQUENCE
    expected = None if factor is None else pytest.approx(factor * PERCENT, rel=0.02)
    assert info.error_bound_percent == expected
    assert info.is_lossless == (factor == 1)
    distances = np.linalg.norm(
        np.concatenate([part.read(0, part.n_frames) for part in decoded.segments])
        - original.vertices,
        axis=2,
    )
    if factor:
        assert distances.max() <= info.error_bound_percent / 100 * info.diagonal
    bounds = {track.name: track.bound for track in info.tracks}
    assert bounds["state"] == 0
    for name in ("heat", "up"):
        values = np.concatenate(
            [part.tracks[name].read(0, part.n_frames) for part in decoded.segments]
        )
        track = meshreel.Track(values, kind=TRACKS[name].kind)
        assert track_errors(original.tracks[name], track).largest <= bounds[name]
    assert bounds["heat"] > (1.5 if again == "bound" else 0.9) * HEAT_BOUND


def test_a_third_generation_adds_again_and_exact_tracks_keep_their_bound(lossy):
    options = {"bound": PERCENT, "tracks": {"heat": "exact"}}
    with pytest.warns(match="bounds include the error"):
        third = meshreel.encode(meshreel.encode(lossy, **options), **options)
    heat, *_ = meshreel.info(third).tracks
    assert meshreel.info(third).error_bound_percent == pytest.approx(3 * PERCENT, rel=0.02)
    assert (heat.is_exact, heat.bound) == (True, pytest.approx(HEAT_BOUND, rel=1e-4))
    assert "within" in str(heat)
    decoded = meshreel.decode(third).tracks["heat"]
    assert decoded.error_bound == heat.bound
    assert track_errors(TRACKS["heat"], decoded).largest <= heat.bound


@pytest.mark.parametrize(
    "source",
    [
        lambda path: meshreel.encode(GRID),
        lambda path: meshreel.decode(path, n_modes=1).replace(tracks={}),
    ],
)
def test_bounds_of_a_source_without_a_bound_are_relative_to_it(lossy, source):
    with pytest.warns(match="relative to the source, .* guarantees none: positions"):
        data = meshreel.encode(source(lossy), max_error=PERCENT)
    assert meshreel.info(data).error_bound_percent == PERCENT


def test_new_positions_and_originals_have_the_bound_alone(lossy):
    decoded = meshreel.decode(lossy)
    values = decoded.tracks["heat"].values + 1
    moved = decoded.replace(vertices=decoded.vertices + 1, tracks={"heat": values})
    with_lossless = meshreel.decode(meshreel.encode(SEQUENCE, lossless=True))
    for original in (moved, SEQUENCE, with_lossless):  # without a warning
        info = meshreel.info(meshreel.encode(original, bound=PERCENT))
        assert info.error_bound_percent == PERCENT
        assert info.tracks[0].bound == pytest.approx(HEAT_BOUND, rel=0.02)
