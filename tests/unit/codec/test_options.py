"""The table of options agrees with everything derived from it."""

import inspect
import math
import subprocess
import sys
from dataclasses import dataclass
from typing import Annotated, Any

import pytest

import meshreel
from meshreel.codec.config import UV_BITS_RANGE, EncoderConfig
from meshreel.codec.encoder import encode
from meshreel.codec.entropy.tables import MAX_GRID_BITS
from meshreel.codec.method_names import METHOD_NAMES
from meshreel.codec.option import Option, Range, numpydoc, options_of_fields, takes_fields
from meshreel.codec.options import FAMILIES, all_options, config_of
from meshreel.codec.reel.encoding.effort import EFFORTS
from meshreel.codec.reel_options import EFFORT_RANGE
from meshreel.errors import InvalidInputError
from samples.meshes import waving_grid

OPTIONS = {option.name: option for option in all_options()}
OTHERS = {"sequence", "attributes", "tracks", "progress"}
"""Parameters of `encode` that are not encoding options."""

IN_WORDS = {
    Range(0, is_open=True): "above 0",
    Range(1): "at least 1",
    Range(2, is_whole=True): "a whole number of at least 2",
    Range(0, 1.5, is_open=True): "above 0 and up to 1.5",
    Range(1, 9, is_whole=True): "1..9",
}

ALLOWED: dict[Range, tuple[list[float], list[float]]] = {
    Range(1, 100): ([1, 80, 99.5, 100], [0.9, 100.1]),
    Range(1, 9, is_whole=True): ([1, 9, 5.0], [0, 10, 2.5]),
    Range(1, is_whole=True): ([1, 10**9], [0, 1.5]),
    Range(0, is_open=True): ([1e-300, 1e300], [0, -1]),
    Range(0, 1, is_open=True): ([1e-9, 1], [0, 1.1]),
    Range(0, 1): ([0, 1], [-0.1, 1.1]),
}
NEVER: list[Any] = [math.nan, math.inf, -math.inf, "5", b"5", None, [5], {}]


@pytest.mark.parametrize("allowed", ALLOWED, ids=str)
def test_range_accepts_only_values_inside(allowed):
    inside, outside = ALLOWED[allowed]
    for number in inside:
        allowed.check(number, "it")
    for number in [*outside, *NEVER]:
        with pytest.raises(InvalidInputError, match=f"^it must be {allowed}, in percent; got"):
            allowed.check(number, "it", "in percent")


def test_names_of_options_are_distinct_in_python_and_on_the_command_line():
    assert len(OPTIONS) == len(all_options())
    assert len({option.flag for option in all_options()}) == len(all_options())


@pytest.mark.parametrize("name", OPTIONS)
def test_option_accepts_its_default_and_describes_it(name):
    option = OPTIONS[name]
    option.check(option.default)
    assert option.help.endswith(".")
    assert option.default in option.names or not option.names or option.default is None
    assert option.names or option.range or option.metavar or option.annotation is bool


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.parametrize("method", METHOD_NAMES)
def test_methods_refuse_options_that_they_lack(method, name):
    option = OPTIONS[name]
    value = 0.5 if option.range is None else max(option.range.low, 1)
    given = next((one for one in option.names if one != option.default), value)
    given = True if option.annotation is bool else given
    if method in option.methods or name == "unit":
        return
    expected = f"method {method} does not take {name}; .* {' or '.join(option.methods)}$"
    with pytest.raises(InvalidInputError, match=expected):
        config_of(method, **{name: given})


def test_every_option_is_supported_by_a_method():
    assert all(set(option.methods) & set(METHOD_NAMES) for option in all_options())
    assert all(set(option.methods) <= set(METHOD_NAMES) for option in all_options())


@pytest.mark.parametrize("function", [encode, meshreel.encode])
def test_encode_has_the_options_of_the_table(function):
    parameters = inspect.signature(function).parameters
    assert set(parameters) == set(OPTIONS) | OTHERS
    for name, option in OPTIONS.items():
        assert parameters[name].default == option.default
        assert parameters[name].annotation == option.annotation


def test_families_extend_the_shared_options_and_share_no_others():
    shared = {option.name for option in options_of_fields(EncoderConfig)}
    own = [{option.name for option in options_of_fields(family)} - shared for family in FAMILIES]
    assert not set.intersection(*own)
    assert set.union(shared, *own) == set(OPTIONS)
    assert not {"energy", "bits", "anchors"} & shared


def test_options_of_another_method_are_accepted_at_their_default():
    defaults = {name: option.default for name, option in OPTIONS.items() if name != "method"}
    assert config_of("pca-qp", **defaults) == config_of("pca-qp")


def test_live_frames_exclude_options_of_the_whole_sequence():
    with pytest.raises(
        InvalidInputError, match=r"^kg needs .* set quality, bound, max_error, step$"
    ):
        config_of(kg=1.0).check_live()
    config_of("pca-qp", n_modes=3).check_live()


@pytest.mark.parametrize("name", OPTIONS)
def test_encode_forwards_every_option(name):
    option = OPTIONS[name]
    with pytest.raises(InvalidInputError, match=rf"\b{name}\b"):
        encode(waving_grid(1), **{name: "none of them" if option.names else -1})


@pytest.mark.parametrize(
    ("name", "advice"),
    [("qualty", "did you mean 'quality'?"), ("modes", "did you mean 'n_modes'?"), ("zzz", "kg")],
)
def test_error_for_an_unknown_option_suggests_the_nearest(name, advice):
    for call in (
        lambda options: config_of(**options),
        lambda options: meshreel.encode(waving_grid(1), **options),
    ):
        with pytest.raises(InvalidInputError, match=f"option '{name}' is unknown") as refused:
            call({name: 1})
        assert advice in str(refused.value)


def test_ranges_agree_with_the_enumerations():
    assert set(EFFORTS) == set(range(int(EFFORT_RANGE.low), int(EFFORT_RANGE.high) + 1))
    assert UV_BITS_RANGE.high == MAX_GRID_BITS


def test_table_is_built_without_importing_numpy():
    """The command line shows its help without importing numerics."""
    code = (
        "import sys; from meshreel.codec.options import all_options; all_options(); "
        "print(*{'numpy', 'scipy', 'DracoPy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.stdout.strip(), done.stderr) == ("", "")


@dataclass(frozen=True)
class Baking:
    """Options of a function outside this package."""

    heat: Annotated[float | None, Option("How hot, see {grill_mode}.", unit="in kelvin")] = None
    grill_mode: Annotated[str, Option("Which.", names=("top", "all"), flag="--grill")] = "top"
    silent: bool = False


def test_annotated_fields_are_options():
    heat, grill = options_of_fields(Baking)
    assert (heat.name, heat.flag, heat.types, heat.default) == ("heat", "--heat", (float,), None)
    assert (grill.name, grill.flag, grill.types, grill.default) == (
        "grill_mode", "--grill", (str,), "top",
    )  # fmt: skip
    assert heat.help_naming("--{}".format) == "How hot, see --grill_mode."


def test_function_takes_fields_as_keywords_and_describes_them():
    @takes_fields(Baking)
    def bake(cake: str, baking: Baking) -> tuple[str, Baking]:
        """A cake.

        Parameters
        ----------
        cake : str
        options
            Of baking.
        silent : bool
        """
        return cake, baking

    assert bake("torte", 450.0, grill_mode="all") == ("torte", Baking(450.0, "all"))
    assert str(inspect.signature(bake)).startswith(
        "(cake: str, heat: float | None = None, grill_mode: str = 'top', silent: bool = False)"
    )
    assert numpydoc(options_of_fields(Baking)[1]) == (
        'grill_mode : {"top", "all"}, default "top"\n    Which.'
    )
    assert bake.__doc__.split("\n")[2:] == [
        "Parameters",
        "----------",
        "cake : str",
        "heat : float, optional",
        "    How hot, see `grill_mode`.",
        'grill_mode : {"top", "all"}, default "top"',
        "    Which.",
        "silent : bool",
    ]


@pytest.mark.parametrize("allowed", IN_WORDS, ids=repr)
def test_range_describes_allowed_values(allowed):
    assert str(allowed) == IN_WORDS[allowed]
