"""Report of a batch: failures, outliers and all inputs."""

import re
from html.parser import HTMLParser

import pytest

from meshreel.app.batch.manifest import DONE, FAILED, PENDING, Manifest, Record
from meshreel.app.batch.out_folder import LocalFolder
from meshreel.app.batch.report import REPORT_NAME, check_report, write_report
from meshreel.errors import InvalidInputError


def record(state, **figures):
    return Record(state, "x.reel", True, "", {}, **figures)


def done(ratio, error):
    size = round(10**6 / ratio)
    return record(
        DONE, ratio=ratio, raw_size_bytes=10**6, size_bytes=size, kg_error_percent=error / 3,
        max_error_percent=error, seconds=1.0, notes=["polygons <cut>"] if ratio == 20 else [],
    )  # fmt: skip


def written(folder, input_dir, records):
    """Return the HTML report of these records."""
    write_report(Manifest(LocalFolder(folder), input_dir, records))
    return (folder / REPORT_NAME).read_text()


@pytest.fixture
def page(tmp_path):
    records = {f"s{number}": done(10 + number, 0.1 + 0.01 * number) for number in range(30)}
    records |= {"bad": record(FAILED, error="is <no> archive"), "late": record(PENDING)}
    return written(tmp_path, "../in", records)


def test_page_begins_with_failures(page):
    assert page.index("1 failure") < page.index("Ratio and error")
    assert "<strong>bad</strong>: is &lt;no&gt; archive" in page


def test_page_shows_each_input_as_a_point_and_a_row(page):
    assert page.count("<circle") == 30
    everything = page[page.rindex("All encoded inputs") :]
    assert re.findall(r"<code>(s\d+)</code>", everything) == [f"s{number}" for number in range(30)]


def test_page_lists_the_lowest_ratios_and_largest_errors(page):
    start = page.index("Least compressed")
    assert re.findall(r"<code>(s\d+)</code>", page[start:])[:10] == [f"s{n}" for n in range(10)]
    start = page.index("Largest errors")
    assert re.findall(r"<code>(s\d+)</code>", page[start:])[:3] == ["s29", "s28", "s27"]


def test_points_are_within_the_plot_and_higher_for_larger_ratios(tmp_path):
    given = [(10, 1.0), (100, 0.1), (20, 0.3)]
    page = written(tmp_path, "../in", {f"s{k}": done(*one) for k, one in enumerate(given)})
    width, height = map(int, re.search(r'viewBox="0 0 (\d+) (\d+)" width', page).groups())
    points = [
        tuple(map(float, found))
        for found in re.findall(r'<circle cx="([-.\d]+)" cy="([-.\d]+)"', page)
    ]
    assert all(0 < x < width and 0 < y < height for x, y in points)
    assert sorted(range(3), key=lambda k: points[k][1]) == [1, 2, 0]
    assert sorted(range(3), key=lambda k: points[k][0]) == [1, 2, 0]
    lines = [float(found) for found in re.findall(r'd="M\d+ ([-.\d]+)H', page)]
    assert [points[0][1], points[1][1]] == pytest.approx(lines, abs=0.11)


def test_page_contains_notes_and_all_states(page):
    assert "<strong>s10</strong>: polygons &lt;cut&gt;" in page
    assert "30 encoded, 1 failed, 1 not done" in page


def test_page_is_well_formed(page):
    open_tags = []

    class Tags(HTMLParser):
        def handle_starttag(self, tag, attrs):
            if tag not in ("meta", "path", "rect", "img"):
                open_tags.append(tag)

        def handle_startendtag(self, tag, attrs):
            pass

        def handle_endtag(self, tag):
            if tag != "rect":
                assert open_tags.pop() == tag

    Tags().feed(page)
    assert open_tags == []


def test_page_of_failures_alone_is_written(tmp_path):
    assert "1 failure" in written(tmp_path, "in", {"bad": record(FAILED, error="no")})


def test_page_of_another_program_is_replaced_only_with_force(tmp_path):
    (tmp_path / REPORT_NAME).write_text("mine")
    with pytest.raises(InvalidInputError, match="is not a report of meshreel batch"):
        check_report(LocalFolder(tmp_path), force=False)
    check_report(LocalFolder(tmp_path), force=True)
    written(tmp_path, "in", {})
    check_report(LocalFolder(tmp_path), force=False)
