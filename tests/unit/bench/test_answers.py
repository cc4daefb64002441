"""Answers from made points: envelopes, knees, rates of fixed settings, numbers of blocks."""

import numpy as np
import pytest
from PIL import Image

from questions.answers import blocks_answer, envelope, knee, rows_answer, search_answers
from questions.plot import draw_rows
from questions.tables import blocks_table, rows_table


def point(rate, error, modes=20, bits=8, **others):
    values = {"rate_bpvf": rate, "kg_error_percent": error, "sted": error / 100}
    return {"modes": modes, "bits": bits, **values, **others}


def test_envelope_is_the_lower_hull_of_log_error_over_rate():
    # At 2 bits the error is below the chord from 1 to 3 bits, at 2.5 above the chord from 2 to 3.
    points = [point(3, 0.25), point(1, 1.0), point(2.5, 0.42), point(2, 0.4), point(2, 0.9)]
    result = envelope(points, "kg_error_percent")
    assert [one["rate_bpvf"] for one in result] == [1, 2, 3]
    assert result[1] is points[3]


def test_envelope_ends_at_the_smallest_error():
    points = [point(1, 1.0), point(2, 0.5), point(3, 0.6)]
    assert [one["rate_bpvf"] for one in envelope(points, "sted")] == [1, 2]


def test_knee_is_the_corner_of_two_lines_on_log_axes():
    rates = np.geomspace(1, 100, 21)
    curve = [(rate, max(1 / rate, 0.1) * rate**-0.01) for rate in rates]
    position, distance = knee(curve)
    assert rates[position] == pytest.approx(10)
    assert distance == pytest.approx(0.5, abs=0.05)


def test_power_law_has_no_knee():
    curve = [(rate, 3 * rate**-1.7) for rate in (1.0, 2.0, 5.0, 30.0)]
    assert knee(curve)[1] == pytest.approx(0, abs=1e-12)
    assert knee(curve[:2]) is None


def test_knee_is_below_the_chord():
    # Above its chord everywhere: the ends have distance 0.
    assert knee([(1.0, 1.0), (3.0, 0.9), (9.0, 0.1)])[1] == pytest.approx(0)


def power_law_points():
    """Rows 2^i at 4 + i bits are optimal at rate 2^i; 20 rows and 8 bits take a fifth more."""
    points = [point(2.0**i / 8, 2.0**-i, 2**i, 4 + i) for i in range(1, 7)]
    return [*points, point(1.2 * 2, 2.0**-4, 20, 8)]


def test_rows_grow_with_the_rate_by_the_exponent():
    answer = rows_answer({"points": power_law_points()})["kg_error_percent"]
    assert answer["growth"] == pytest.approx(1)
    assert answer["knee"]["distance"] == pytest.approx(0, abs=1e-12)


def test_best_rows_are_those_at_the_last_rate_of_the_envelope():
    best = rows_answer({"points": power_law_points()})["sted"]["best"]
    assert [(one["modes"], one["bits"]) for one in best] == [(2, 5), (4, 6), (8, 7), (16, 8)]
    few = [point(0.9, 2.0, 3, 5), point(1.5, 1.0, 5, 5)]
    best = rows_answer({"points": few})["sted"]["best"]
    assert best[:2] == [None, None]
    assert best[2]["modes"] == 3


def test_rate_of_the_tables_is_relative_to_the_envelope_at_equal_error():
    answer = rows_answer({"points": power_law_points()})["kg_error_percent"]
    assert answer["table"] == pytest.approx(20)
    assert answer["table_rows"] is None  # a single point has no BD-rate


def test_fixed_rows_are_compared_by_bd_rate():
    points = power_law_points()
    points += [point(1.5 * 2.0**i / 8, 2.0**-i, 20, 4 + i) for i in (2, 3, 5)]
    points[6] = point(1.5 * 2, 2.0**-4, 20, 8)
    answer = rows_answer({"points": points})["kg_error_percent"]
    assert answer["table_rows"] == pytest.approx(50, abs=0.5)


def test_knee_over_rows_is_of_the_streams_with_8_bits():
    rows = (1, 2, 4, 8, 16, 32)
    points = [point(modes, max(1 / modes, 0.2), modes, 8) for modes in rows]
    points += [point(modes, 1.0, modes, 5) for modes in rows]
    answer = rows_answer({"points": points})["sted"]
    assert answer["row_knee"]["modes"] == 4
    assert answer["row_knee"]["bits"] == 8


def test_errors_of_zero_are_left_out():
    points = [*power_law_points(), point(50, 0.0, 80, 12)]
    assert rows_answer({"points": points}) == rows_answer({"points": power_law_points()})


def block_points(**factors):
    curves = {int(name[1:]): factor for name, factor in factors.items()}
    return [
        {"blocks": n_blocks, "rate_bpvf": factor * rate, "kg_error_percent": 1 / rate}
        for n_blocks, factor in curves.items()
        for rate in (1, 2, 4)
    ]


def test_best_number_of_blocks_has_the_lowest_rate():
    answer = blocks_answer({"points": block_points(n1=1.0, n2=0.9, n7=1.3), "usual_blocks": 7})
    assert answer["best"] == 2
    assert answer["rates"] == {
        "1": 0.0, "2": pytest.approx(-10), "7": pytest.approx(30)
    }  # fmt: skip
    assert answer["usual"] == 7


def test_numbers_of_blocks_without_common_errors_are_not_compared():
    points = block_points(n1=1.0)
    points += [{"blocks": 3, "rate_bpvf": rate, "kg_error_percent": 50 / rate} for rate in (1, 2)]
    answer = blocks_answer({"points": points, "usual_blocks": 3})
    assert answer["rates"]["3"] is None
    assert answer["best"] == 1


RESULTS = {
    "rows": {"points": power_law_points()},
    "blocks": {"points": block_points(n1=1.0, n2=1.1), "usual_blocks": 2},
}


def test_tables_have_a_row_for_each_sequence():
    answers = search_answers(RESULTS)
    tables = {
        question: make([("walk", answers[question])])
        for question, make in (("rows", rows_table), ("blocks", blocks_table))
    }
    for table in tables.values():
        assert all(len(row) == len(table.header) for row in table.rows)
    rows, blocks = (tables[question].rows for question in ("rows", "blocks"))
    assert rows[0][1:6] == ("KG", "2 x 5", "4 x 6", "8 x 7", "16 x 8")
    assert rows[0][6:] == ("1.00", "none (0.00)", "-", "+20.0 %", "-", "-")
    assert blocks[0][:3] == ("walk", "1", "+10.0 %")
    assert blocks[0][-1] == "+10.0 % (2)"


@pytest.mark.slow
@pytest.mark.parametrize("n_rows", [1, 6])
def test_search_over_rows_is_drawn(n_rows, tmp_path):
    points = [
        point(2.0**i, max(2.0**-i, 0.2), 2**i, 4 + i, **({"sted": None} if n_rows == 1 else {}))
        for i in range(n_rows)
    ]
    draw_rows({"points": points}, tmp_path / "rows.png")
    with Image.open(tmp_path / "rows.png") as image:
        assert image.width > 1000
