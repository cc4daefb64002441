"""Streams of `reel` meet their targets, also those given as text with units."""

import re
from dataclasses import asdict
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import meshreel
from meshreel.codec.options import config_of
from meshreel.codec.reel.encoding.effort import EFFORTS, choices_for, tune_named
from meshreel.codec.reel_options import ReelOptions, Tune
from meshreel.codec.targets import DEFAULT_QUALITY, Target, TargetKind, target_of
from meshreel.errors import InvalidInputError
from samples.costs import slow_but
from samples.meshes import irregular_sequence, waving_grid
from samples.orders import shuffled

SEQUENCES = {
    "grid": waving_grid(),
    "irregular": irregular_sequence(),
    "one frame": waving_grid(1),
    "still": meshreel.MeshSequence(
        np.repeat(waving_grid(1).vertices, 9, axis=0), waving_grid(1).faces
    ),
}

ERRORS = {"kg": [0.01, 0.3, 5.0, 90.0], "max_error": [0.002, 0.05, 1.0, 20.0]}
SHARES = [0.5, 1.0, 1.7]
"""Shares of the size of a stream of the default quality."""


@cache
def encoded(name, **options):
    return meshreel.encode(SEQUENCES[name], **options)


def measured(sequence, data):
    """Errors and size of a stream of a sequence or of its name, computed independently."""
    sequence = SEQUENCES[sequence] if isinstance(sequence, str) else sequence
    quality = meshreel.compare(sequence, data)
    return {
        "kg": quality.kg_error_percent,
        "max_error": quality.max_error_percent,
        "size": len(data),
    }


@pytest.mark.parametrize("name", slow_but(["irregular"], SEQUENCES))
@pytest.mark.parametrize(
    ("kind", "limit"), [(kind, limit) for kind, limits in ERRORS.items() for limit in limits]
)
def test_error_target_is_met(name, kind, limit):
    error = measured(name, encoded(name, **{kind: limit}))[kind]
    assert error <= limit
    if kind == "kg" and limit < 1:  # an error below its target costs bytes
        assert error > 0.85 * limit


@pytest.mark.parametrize("name", slow_but(["grid"], SEQUENCES))
@pytest.mark.parametrize("share", SHARES)
def test_size_target_is_met(name, share):
    limit = share * len(encoded(name))
    try:
        data = encoded(name, size=limit)
    except InvalidInputError as error:  # connectivity alone takes more bytes
        message = str(error)
        assert share < 1
        assert f"size {limit:g} cannot be met" in message
        return
    assert (0.95 * limit if name == "grid" else 0) < len(data) <= limit


def test_twelve_points_of_quality_halve_the_error():
    errors = [
        measured("grid", encoded("grid", quality=number))["kg"] for number in (52, 64, 76, 88)
    ]
    for coarse, fine in pairwise(errors):
        assert 1.4 < coarse / fine < 2.8


def test_default_quality_applies_without_a_target():
    assert encoded("grid") == encoded("grid", quality=DEFAULT_QUALITY)


def test_quality_does_not_depend_on_the_travel_of_the_model():
    """A step is relative to the size of the model, not to the box of all frames."""
    grid = waving_grid(12, dtype=np.float64)
    path = np.linspace(0, 50, 12)[:, None, None] * [1.0, 0.2, 0.0]
    travelling = meshreel.MeshSequence(grid.vertices + path, grid.faces)
    still, moved = (
        meshreel.compare(one, meshreel.decode(meshreel.encode(one))).kg_error_percent
        for one in (grid, travelling)
    )
    assert moved == pytest.approx(still, rel=0.3)


@pytest.mark.every_case
@pytest.mark.parametrize(("kind", "limit"), [("size", 50), ("kg", 1e-12)])
def test_too_small_target_is_refused_with_the_smallest_possible(kind, limit):
    with pytest.raises(InvalidInputError, match=f"{kind} {limit} cannot be met") as refused:
        encoded("grid", **{kind: limit})
    message = str(refused.value)
    [reached] = map(float, re.findall(r"the smallest .*? is ([\d.e-]+)", message))
    if kind == "size":
        assert 'order="drop"' in message
        assert len(encoded("grid", size=1.03 * reached)) <= 1.03 * reached
    else:
        assert limit < reached < 1e-4


def test_size_reported_as_smallest_is_the_smallest():
    with pytest.raises(InvalidInputError, match=r"drop the order \(order=") as refused:
        encoded("grid", size=10)
    [smallest] = map(int, re.findall(r"is (\d+) bytes", str(refused.value)))
    assert len(encoded("grid", size=smallest)) == smallest
    with pytest.raises(InvalidInputError, match=f"is {smallest} bytes"):
        encoded("grid", size=smallest - 1)


def test_advice_on_a_size_omits_dropping_a_dropped_order():
    with pytest.raises(InvalidInputError, match=r"bytes; allow more$"):
        encoded("grid", size=10, order="drop")


def test_maximum_error_below_the_precision_of_the_number_type_is_refused():
    far = meshreel.MeshSequence(waving_grid().vertices + np.float32(1e5), waving_grid().faces)
    spacing = 100 * np.spacing(np.float32(1e5)) / np.linalg.norm(np.ptp(far.vertices, axis=(0, 1)))
    with pytest.raises(InvalidInputError, match=r"cannot be guaranteed.* float32 .*as float64"):
        meshreel.encode(far, max_error=0.5 * spacing)
    for percent in (4 * spacing, 40 * spacing):
        decoded = meshreel.decode(meshreel.encode(far, max_error=percent))
        assert meshreel.compare(far, decoded).max_error_percent <= percent


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("scale", "dtype", "percent", "is_met"),
    [
        (1.0, np.float64, 1e-7, True),
        (1.0, np.float64, 1e-8, False),
        (1.0, np.float64, 1e-12, True),
        (1e-42, np.float32, 0.1, False),  # denormal positions
        (1e-43, np.float32, 1.0, False),
        (1e-300, np.float64, 0.1, True),  # squares of coordinates underflow
    ],
)
def test_maximum_error_near_the_precision_of_numbers_is_met_or_refused(
    scale, dtype, percent, is_met
):
    grid = waving_grid(4, dtype=np.float64)
    sequence = meshreel.MeshSequence((grid.vertices * scale).astype(dtype), grid.faces)
    try:
        data = meshreel.encode(sequence, max_error=percent)
    except InvalidInputError as error:
        message = str(error)
        assert not is_met
        assert f"max_error {percent:g}" in message
        return
    assert meshreel.compare(sequence, meshreel.decode(data)).max_error_percent <= percent


def test_maximum_error_below_the_precision_of_float64_is_refused():
    fine = meshreel.MeshSequence(waving_grid().vertices.astype(np.float64), waving_grid().faces)
    with pytest.raises(
        InvalidInputError, match="percent of the diagonal; encode losslessly"
    ) as refused:
        meshreel.encode(fine, max_error=1e-14)
    least = float(str(refused.value).split("at least ")[1])
    decoded = meshreel.decode(meshreel.encode(fine, max_error=least))
    assert meshreel.compare(fine, decoded).max_error_percent <= least


OPTIONS = [
    *({"tune": tune} for tune in ("visual", "geometry")),
    *({"effort": effort} for effort in EFFORTS),
    *({"order": order} for order in ("drop", "vertices")),
    {"block_frames": 5},
]
QUICK = [{"tune": "visual"}, {"tune": "geometry"}, {"effort": 1}, {"effort": 9}, {"order": "drop"}]


@pytest.mark.parametrize("options", slow_but(QUICK, OPTIONS), ids=str)
@pytest.mark.parametrize(("kind", "limit"), [("kg", 0.2), ("max_error", 0.05)])
def test_error_target_is_met_with_every_option(options, kind, limit):
    sequence = shuffled(waving_grid(), 1)
    data = meshreel.encode(sequence, **{kind: limit}, **options)
    assert measured(sequence, data)[kind] <= limit


def test_more_effort_takes_fewer_bytes():
    sequence = waving_grid(40, 40, 40)
    low, high = (len(meshreel.encode(sequence, kg=0.3, effort=effort)) for effort in (1, 9))
    assert high < low


@pytest.mark.parametrize("kind", TargetKind)
def test_default_tune_suits_the_target(kind):
    serves_geometry = kind in (TargetKind.KG, TargetKind.MAX_ERROR)
    expected = Tune.GEOMETRY if serves_geometry else Tune.VISUAL
    target = Target(kind, 1.0)
    assert tune_named(None, target) is expected
    assert [tune_named(tune.value, target) for tune in Tune] == list(Tune)


@pytest.mark.parametrize("kind", TargetKind)
def test_target_is_the_option_with_a_number(kind):
    assert target_of(**{one.value: 1.0 if one is kind else None for one in TargetKind}) == Target(
        kind, 1.0
    )


def test_error_names_two_targets_when_there_are_several():
    with pytest.raises(InvalidInputError, match="kg and size exclude each other"):
        target_of(kg=1.0, quality=None, size=900, step=0.1)


def test_steps_as_large_as_the_model_are_used_unchanged():
    sizes = [len(meshreel.encode(waving_grid(20, 12, 13), step=step)) for step in (0.1, 0.3)]
    assert sizes[1] < sizes[0]


def test_number_of_modes_rises_as_the_error_bound_falls():
    rng, time = np.random.default_rng(5), np.arange(30)[:, None, None]
    sheet = waving_grid(1)
    fields = rng.normal(size=(10, 1, *sheet.vertices.shape[1:])) * 10.0 ** -np.arange(10).reshape(
        10, 1, 1, 1
    )
    waves = sum(field * np.cos((k + 1) * time / 9) for k, field in enumerate(fields))
    sequence = meshreel.MeshSequence(sheet.vertices.astype(np.float64) + waves, sheet.faces)
    errors = (1e-3, 1e-5, 1e-7)
    counts = [
        sum(meshreel.info(meshreel.encode(sequence, max_error=error)).n_modes) for error in errors
    ]
    assert counts[0] + 2 <= counts[1]
    assert counts[1] + 2 <= counts[2]


@pytest.mark.parametrize("effort", EFFORTS)
def test_parameters_of_every_effort_fit_the_format(effort):
    for tune in Tune:
        choices = choices_for(effort, tune, None)
        assert 1 <= choices.stencil_size <= 16
        assert 0 <= choices.n_learned <= 255


def test_number_of_modes_is_limited_in_a_search():
    data = encoded("grid", size=2000, n_modes=3)
    assert meshreel.info(data).n_modes == (3,)


def test_stream_with_a_huge_allowed_error_is_readable():
    meshreel.decode(encoded("grid", max_error=3e8))


def test_error_target_of_coincident_vertices_is_met_or_refused():
    path = np.array([[0.125, -0.13, 0.64], [-0.118, -0.1416, 0.502]], np.float32)
    sequence = meshreel.MeshSequence(np.repeat(path[:, None], 3, axis=1), np.array([[0, 1, 2]]))
    try:
        data = meshreel.encode(sequence, kg=0.01)
    except InvalidInputError as error:
        message = str(error)
        assert "cannot be met" in message
        return
    np.testing.assert_array_equal(meshreel.decode(data).vertices, sequence.vertices)


def heard(**target):
    results = []
    meshreel.encode(
        waving_grid(), **target, progress=lambda stage, share: results.append((stage, share))
    )
    return results


@pytest.mark.parametrize("target", [{"kg": 0.5}, {"size": 1500}, {"max_error": 0.05}])
@pytest.mark.parametrize("block_frames", [None, 4])
def test_search_reports_shares_of_all_tries_that_rise(target, block_frames):
    result = heard(**target, block_frames=block_frames)
    tries = [(stage, share) for stage, share in result if stage.startswith("encoding, try")]
    stages, shares = zip(*tries, strict=True)
    assert tries[0] == ("encoding, try 1 of about 6", 0.0)
    assert ("encoding, try 2 of about 6", 1 / 6) in tries
    assert "encoding, try 7 of about 6" not in stages
    assert list(shares) == sorted(shares)
    assert shares[-1] < 1


def test_single_trial_reports_completion():
    assert heard(quality=60)[-1] == ("encoding", 1.0)


@pytest.mark.parametrize(
    ("text", "number"),
    [({"max_error": "0.05%"}, {"max_error": 0.05}), ({"size": "1kB"}, {"size": 1000})],
    ids=str,
)
def test_target_as_text_gives_the_same_stream(text, number):
    assert meshreel.encode(waving_grid(), **text) == meshreel.encode(waving_grid(), **number)


@pytest.mark.parametrize(
    ("max_error", "unit", "in_units"),
    [("0.002u", None, 0.002), ("2mm", "m", 0.002), ("0.02mm", "cm", 0.002)],
)
def test_every_vertex_is_within_a_bound_in_length_units(max_error, unit, in_units):
    sequence = waving_grid()
    data = meshreel.encode(sequence, max_error=max_error, unit=unit)
    apart = meshreel.decode(data).vertices.astype(float) - sequence.vertices
    assert in_units / 20 < np.linalg.norm(apart, axis=2).max() <= in_units
    stream = meshreel.info(data)
    bound = stream.error_bound_percent / 100 * stream.diagonal
    assert bound == pytest.approx(in_units, rel=1e-12)


def test_options_given_as_text_are_numbers():
    config = config_of(max_error="0.5mm", unit="cm", memory="1kB")
    assert config == ReelOptions(max_error="0.05u", memory=1000.0)
    assert config_of(**asdict(config)) == config


def test_refused_bound_is_reported_in_the_unit_of_the_request():
    words = r"1e-12 model units are .* % of the diagonal: max_error .* cannot be guaranteed"
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(waving_grid(), max_error="1e-12u")


def test_unit_without_a_number_is_refused():
    with pytest.raises(InvalidInputError, match="unit applies to a length in max_error"):
        config_of(unit="mm")
