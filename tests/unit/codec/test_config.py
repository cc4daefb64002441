from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from meshreel.codec.config import MAX_BLOCK_POSITIONS
from meshreel.codec.memory import bytes_of
from meshreel.codec.options import config_of
from meshreel.codec.track_bounds import unit_ratio
from meshreel.errors import InvalidInputError

TARGETS = {"quality": 80, "step": 0.001, "max_error": 0.1, "kg": 0.5, "size": 900}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "zip"}, "method 'zip' is unknown; choose pca-qp, pca, pca-q, v2v, pca-qs,"),
        ({"method": "pca-qp", "n_modes": 5, "energy": 0.9}, "exclude each other"),
        ({"n_modes": 0}, "n_modes must be a whole number of at least 1; got 0"),
        ({"n_modes": 2.5}, "n_modes must be a whole number"),
        ({"method": "pca-qp", "energy": 0.0}, "energy must be"),
        ({"method": "pca-qp", "energy": 1.5}, "energy must be"),
        ({"method": "pca-qp", "bits": 1}, "bits must be 2..24; got 1"),
        ({"method": "pca-qp", "bits": 40}, "bits must be 2..24; got 40"),
        ({"method": "pca-qp", "anchors": 1.5}, "anchors must be 0..1, a share"),
        ({"method": "pca-qp", "anchors": float("nan")}, "anchors must be 0..1, a share"),
        ({"laplacian": "fancy"}, "laplacian 'fancy' is unknown; choose normalized, combinatorial"),
        ({"laplacian": np.eye(3)}, "laplacian of type ndarray is unknown; choose normalized"),
        ({"order": "some"}, "order 'some' is unknown; choose keep, vertices, drop"),
        ({"block_frames": 0}, "block_frames must be"),
        ({"method": "blocks", "n_iterations": 0}, "n_iterations must be"),
        (
            {"method": "pca-qp", "allocation": "even"},
            "allocation 'even' is unknown; choose energy, constant",
        ),
        ({"method": "pca-qp", "bits": []}, "bits is an empty list"),
        ({"method": "pca-qp", "bits": [8, 1]}, "bits of row 1 must be 2..24, or 0; got 1"),
        ({"method": "pca-q", "anchors": 0.01}, "pca-q decodes with L alone"),
        ({"method": "v2v", "anchors": 0.01}, "v2v decodes with the product"),
        *(
            ({"method": "pca-qp", name: value}, f"pca-qp does not take {name};.* choose reel")
            for name, value in {**TARGETS, "tune": "visual", "effort": 5}.items()
        ),
        *(
            ({name: value}, f"reel does not take {name}; .* choose pca-qp or pca or")
            for name, value in {
                "bits": 8,
                "anchors": 0.1,
                "energy": 0.9,
                "allocation": "constant",
                "laplacian": "combinatorial",
            }.items()
        ),
        ({"n_iterations": 7}, "reel does not take n_iterations;.* choose blocks"),
        ({"method": "pca-qp", "n_iterations": 7}, "pca-qp does not take n_iterations;"),
        (
            {"method": "v2v", "laplacian": "combinatorial"},
            "v2v does not take laplacian;.* choose pca-qp or .* or gft$",
        ),
        *(
            ({name: value}, f"{name} must be above 0(, in .*)?; got {value}")
            for name in TARGETS
            if name not in ("quality", "step")
            for value in (0, -1.5, float("inf"), float("nan"))
        ),
        *(
            ({"quality": value}, rf"quality must be 1\.\.100; got {value}")
            for value in (0.9, 100.5, float("nan"))
        ),
        *(
            ({"step": value}, "step must be above 0 and up to 1, in diagonals of the bounding box")
            for value in (0.0, -1.0, 1.1, float("nan"))
        ),
        *(({"effort": value}, f"effort must be 1..9; got {value}") for value in (0, 10, 2.5)),
        *(
            ({name: value}, f"{name} must be .*; got")
            for name, value in {"quality": "high", "effort": "5", "kg": [1, 2], "size": [1]}.items()
        ),
        ({"tune": "loud"}, "tune 'loud' is unknown; choose visual, geometry"),
        *(
            ({one: TARGETS[one], other: TARGETS[other]}, f"{one} and {other} exclude each other")
            for one, other in combinations(TARGETS, 2)
        ),
        ({"method": "gft", "energy": 0.9}, "gft keeps a number of low frequencies"),
        ({"method": "gft", "bits": [8, 8]}, "gft takes one number of bits"),
        ({"method": "gft", "allocation": "constant"}, "gft has one step"),
    ],
)
def test_config_reports_allowed_values_of_an_option(options, message):
    with pytest.raises(InvalidInputError, match=message):
        config_of(**options)


@pytest.mark.parametrize(
    ("config", "changes", "message"),
    [
        (config_of("pca-qp", n_modes=5), {"energy": 0.9}, "exclude each other"),
        (config_of("grid", step=0.001), {"step": None}, "set max_error .or step"),
    ],
)
def test_changed_config_is_checked_too(config, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        replace(config, **changes)


@pytest.mark.parametrize("n_frames", [1, 2, 1000, 1001])
def test_blocks_within_memory_are_of_equal_length(n_frames):
    n_verts = MAX_BLOCK_POSITIONS // 300
    size = config_of().frames_in_block(n_frames, n_verts, 4)
    assert size * n_verts <= MAX_BLOCK_POSITIONS
    n_blocks = -(-n_frames // size)
    assert n_blocks == -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)


@pytest.mark.parametrize("number_bytes", [4, 8])
@pytest.mark.parametrize("method", ["reel", "lossless", "pca-qp"])
def test_blocks_are_as_long_as_memory_allows(method, number_bytes):
    config = config_of(method=method, memory="500MB", block_frames=5000)
    size = config.frames_in_block(5000, 10_000, number_bytes)
    assert 20 < size < 5000
    for block_frames, is_enough in ((size, True), (size + 1, False)):
        needed = config.with_blocks_of(block_frames, 10_000, number_bytes).memory
        assert (needed <= 500e6) == is_enough


@pytest.mark.parametrize("n_verts", [100, 10**6])
def test_memory_for_blocks_of_100_frames_gives_such_blocks(n_verts):
    config = config_of().with_blocks_of(100, n_verts, 4)
    assert config.frames_in_block(200, n_verts, 4) == 100


@pytest.mark.parametrize(
    ("options", "n_frames", "n_verts", "expected"),
    [
        ({}, 5000, 100, 5000),
        ({"block_frames": 30}, 5000, 100, 30),
        ({"memory": "6GB"}, 200, 10**6, 200),
        ({"memory": "1TB"}, 10_000, 10_000, 500),
        ({}, 10_000, 10_000, 500),
        ({}, 1024, 10_000, 1024),
        ({}, 1025, 10_000, 342),
        ({}, 1025, 1 << 12, 1025),
    ],
)
def test_blocks_of_many_vertices_are_of_equal_length(options, n_frames, n_verts, expected):
    assert config_of(**options).frames_in_block(n_frames, n_verts, 4) == expected


@pytest.mark.parametrize(
    ("unit", "other", "ratio"),
    [
        ("mm", "m", 1e-3),
        ("in", "mm", 25.4),
        ("ft", "in", 12),
        ("MPa", "Pa", 1e6),
        ("N/mm^2", "MPa", 1),
        ("psi", "kPa", 6.894757293168361),
        ("km/h", "m/s", 1 / 3.6),
        ("kg*m^2", "g.cm^2", 1e7),
        ("m*s^-2", "mm/s^2", 1e3),
        ("J/kg/K", "m^2/s^2/K", 1),
        ("kW", "J/s", 1e3),
        ("degC", "K", 1),
        ("deg", "rad", 0.017453292519943295),
        ("min", "ms", 60_000),
        ("m3/s", "m^3/s", 1),
        ("ksi", "GPa", 6.894757293168361e-3),
        ("bar", "kPa", 100),
        ("t", "lb", 1e3 / 0.45359237),
        ("h", "us", 3.6e9),
        ("V*A", "nW", 1e9),
        ("Hz", "s^-1", 1),
        ("cN*m", "J", 1e-2),
    ],
)
def test_units_of_one_quantity_convert(unit, other, ratio):
    assert unit_ratio(unit, other) == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "other"),
    [("mm", "s"), ("MPa", "N"), ("m", "m^2"), ("foo", "m"), ("m", ""), ("kft", "m"), ("m//s", "m"),
     ("m^", "m"), ("3m", "m"), ("m/", "m"), ("mkm", "m"), ("%", "m")],
)  # fmt: skip
def test_others_do_not(unit, other):
    assert unit_ratio(unit, other) is None


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (100000, 100000),
        ("100000", 100000),
        ("100kB", 100000),
        ("100 KB", 100000),
        ("1MiB", 1 << 20),
        ("1.5mb", 1.5e6),
        (".5GiB", 1 << 29),
        ("1e5", 100000),
        ("12B", 12),
        ("15k", 15000),
        ("2M", 2e6),
    ],
)
def test_sizes_are_parsed_to_bytes(given, expected):
    assert bytes_of(given, "size") == expected


@pytest.mark.parametrize(
    "given", ["", "kB", "100 apples", "-5kB", "1..2", "nan", "0x10", "10kb2", "10K3"]
)
def test_text_that_is_not_a_size_is_refused(given):
    with pytest.raises(InvalidInputError, match="size takes a size such as 100kB or 1GiB"):
        bytes_of(given, "size")


@pytest.mark.parametrize("given", [0, "0kB", -1, float("nan"), float("inf"), "1e999"])
def test_size_not_above_0_is_refused(given):
    with pytest.raises(InvalidInputError, match="memory must be above 0"):
        bytes_of(given, "memory")
