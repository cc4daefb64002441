import re

import pytest

from meshreel.paper.study.study import PaperStudy
from meshreel.rendering.documents import Paragraph
from meshreel.studies.study import document, publish
from samples.paper_results import made_result, made_sequence


@pytest.mark.slow
def test_html_needs_no_other_file(evaluation):
    html = evaluation.html.read_text(encoding="utf-8")
    sources = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", html)
    assert len(sources) == 7
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"<link|<script|@import|url\(", html)


@pytest.mark.slow
def test_markdown_refers_to_existing_pictures(evaluation, folder):
    names = re.findall(r"!\[[^]]*\]\(([^)]*)\)", evaluation.markdown.read_text(encoding="utf-8"))
    assert len(names) == 7
    assert all((folder / name).is_file() for name in names)


@pytest.mark.slow
def test_report_contains_the_required_statements(evaluation):
    markdown, html = (
        path.read_text(encoding="utf-8") for path in (evaluation.markdown, evaluation.html)
    )
    html = re.sub(r"<[^>]+>", "", html)
    for words in (
        "meshreel paper --frames 12",
        "Table I, flag",
        "Table II, flag",
        "PCA+qs and PCA+qp have equal quality: yes",
        "frequencies, decomposed for each frame",
        "Extrapolated from 2 decompositions",
        "docs/equations.md",
        "NumPy",
    ):
        assert words in markdown, words
        assert words in html, words


def test_report_contains_refusals(tmp_path):
    refused = {**made_result("gft"), "refused": "too <many> vertices"}
    results = made_sequence("samba", [made_result("pca"), refused])
    markdown, html = publish(document(PaperStudy(), [(results, [])], "meshreel paper"), tmp_path)
    assert "`gft` refused samba: too <many> vertices" in markdown.read_text(encoding="utf-8")
    assert "<code>gft</code> refused samba: too &lt;many&gt; vertices" in html.read_text(
        encoding="utf-8"
    )


def test_report_distinguishes_jumping_from_handstand():
    results = made_sequence("jumping", [made_result("pca")])
    parts = document(PaperStudy(), [(results, [])], "x").parts
    texts = [part.text for part in parts if isinstance(part, Paragraph)]
    assert any("another sequence" in text for text in texts)


@pytest.mark.parametrize(
    ("full", "words"),
    [
        ({"refused": "all 9971 graph frequencies would take about 2 hours"}, "would take about 2"),
        (
            {"n_verts": 9971, "seconds": 6.0, "processor_seconds": 6.0, "memory_bytes": 1.6e9},
            "All frequencies: Extrapolated from one decomposition of 9,971 vertices, 6 s:",
        ),
    ],
)
def test_note_below_the_seconds_explains_all_frequencies(full, words):
    results = made_sequence("samba", [made_result("gft")], full_decomposition=full)
    parts = document(PaperStudy(), [(results, [])], "x").parts
    assert any(words in part.text for part in parts if isinstance(part, Paragraph))
