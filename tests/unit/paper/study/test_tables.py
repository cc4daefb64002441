import pytest

from meshreel.paper.study.tables import (
    TABLE_1,
    alternatives_table,
    misprints,
    quality_table,
    rate_table,
    refusals,
    seconds_table,
)
from meshreel.paper.sweeps import COEFFICIENTS
from samples.paper_results import made_result, made_sequence

EACH = {"seconds_each": 2.0, "processor_seconds_each": 3.0}
FULL = {"n_verts": 9971, "seconds": 200.0, "processor_seconds": 300.0, "memory_bytes": 1.6e9}
ALL_FREQUENCIES = "gft, all frequencies, decomposed for each frame *"


@pytest.fixture
def refused():
    return {**made_result("gft"), "refused": "500 frequencies need 7 GB"}


def cells(table):
    return {row[0]: dict(zip(table.header[1:], row[1:], strict=True)) for row in table.rows}


def test_rates_of_samba_are_next_to_the_printed_ones():
    table = rate_table(made_sequence("samba", [made_result("pca-qp"), made_result("blocks")]))
    assert cells(table)["pca-qp"]["q, paper"] == "0.1827"
    assert cells(table)["pca-qp"]["q"] == "0.4000"
    assert cells(table)["pca-qp"]["q as stored"] == "0.2500"
    assert cells(table)["blocks"]["q_s, paper"] == "0.6155"


def test_half_of_the_anchors_has_no_printed_figure():
    results = made_sequence("samba", [made_result("pca-qp", anchors=0.005)])
    for table in (rate_table(results), seconds_table(results)):
        row = cells(table)["pca-qp (0.5 %)"]
        assert {value for name, value in row.items() if "paper" in name} == {"-"}


@pytest.mark.parametrize("name", ["jumping", "flag", "my samba"])
def test_other_sequences_have_no_printed_figures(name):
    results = made_sequence(name, [made_result("pca-qp")])
    for table in (rate_table(results), seconds_table(results)):
        assert not any("paper" in heading for heading in table.header)


def test_seconds_of_handstand_are_next_to_the_printed_ones():
    variants = [made_result("pca-qs", seconds=(0.5, 15.42))]
    table = seconds_table(made_sequence("handstand", variants, n_verts=10002))
    result = list(cells(table)["pca-qs"].values())
    assert result == ["1", "30.8", "0.89", "4736.25"]


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("name", "n_verts", "encode", "decode"),
    [
        ("dinosaur", 20218, "0.69", "45.53"),
        ("chinchilla", 4307, "0.10", "4.68"),
        ("camel-gallop", 21887, "0.12", "56.88"),
        ("flag", 2704, "2.38", "2.37"),
    ],
)
def test_every_mesh_of_table_2_has_its_printed_seconds(name, n_verts, encode, decode):
    table = seconds_table(made_sequence(name, [made_result("pca-qp")], n_verts=n_verts))
    assert list(cells(table)["pca-qp"].values())[-2:] == [encode, decode]


def test_alternatives_are_below_their_variant():
    results = made_sequence(
        "x",
        [made_result("pca-qp"), made_result("blocks")],
        alternatives=[made_result("pca-qp", choices=COEFFICIENTS)],
    )
    labels = [row[0] for row in alternatives_table(results).rows]
    assert labels == ["pca-qp", "pca-qp (coefficients of anchors)"]


def test_printed_per_mesh_figure_is_next_to_the_row_with_all_frequencies():
    graph = made_result("gft", seconds=(6.0, 50.0))
    results = made_sequence("samba", [graph], decompositions=EACH, full_decomposition=FULL)
    rows = cells(seconds_table(results))
    # 174 more decompositions of 3 s of the processor.
    assert list(rows["gft, 20 frequencies, decomposed for each frame *"].values()) == [
        "534", "622", "-", "-",
    ]  # fmt: skip
    # 175 decompositions of 300 s of the processor.
    assert list(rows[ALL_FREQUENCIES].values()) == [
        "52500", "52500", "37314.55", "4214.55",
    ]  # fmt: skip
    assert list(rows["gft, 20 frequencies, decomposed once"].values()) == [
        "12",
        "100",
        "-",
        "-",
    ]


@pytest.mark.parametrize("full", [None, {"refused": "too slow"}])
def test_row_with_all_frequencies_has_printed_figures_when_none_are_measured(full):
    made = {
        name: cells(
            seconds_table(made_sequence(name, [made_result("gft")], full_decomposition=full))
        )
        for name in ("samba", "x")
    }
    wanted = ["-", "-", "37314.55", "4214.55"]
    assert list(made["samba"][ALL_FREQUENCIES].values()) == wanted
    assert ALL_FREQUENCIES not in made["x"]


def test_row_with_all_frequencies_is_complete_without_a_printed_figure():
    for name, n_verts in (("dinosaur", 20218), ("x", 9971)):
        results = made_sequence(
            name, [made_result("gft")], n_verts=n_verts, full_decomposition=FULL
        )
        table = seconds_table(results)
        assert {len(row) for row in table.rows} == {len(table.header)}
        assert ALL_FREQUENCIES in cells(table)


def test_rows_of_refused_variants_are_complete(refused):
    results = made_sequence("samba", [made_result("pca"), refused])
    for table in (rate_table(results), quality_table(results), seconds_table(results)):
        assert {len(row) for row in table.rows} == {len(table.header)}
        assert "refused" in table.rows[1]


def test_refusal_states_its_reason(refused):
    assert refusals(made_sequence("samba", [made_result("pca"), refused])) == [
        "`gft` refused samba: 500 frequencies need 7 GB"
    ]


def test_misprinted_sums_of_table_1_are_named():
    assert misprints("samba") == (
        "Printed q_s that are not the sums of their parts: pca 1.0088 (the sum is 1.0097), "
        "v2v 0.8761 (the sum is 0.8765), pca-qs 0.6226 (the sum is 0.6230), pca-qp 0.6226 (the "
        "sum is 0.6230), blocks 0.6155 (the sum is 0.6150)."
    )
    assert misprints("handstand") == misprints("cow") == ""


def test_printed_anchors_of_samba_are_those_of_the_vertices_of_handstand():
    assert TABLE_1["samba"]["blocks"].q_a == pytest.approx(16 * 99.71 / 10_002, abs=5e-5)
    assert pytest.approx(0.1605, abs=5e-5) == 16 * 100 / 9_971
