import pytest

from meshreel.rendering.documents import (
    Bullets,
    Code,
    Heading,
    Paragraph,
    Table,
    number,
    scientific,
    significant,
    to_html,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.14472, "0.145"), (12.34, "12.3"), (37314.55, "37300"), (1.2e-5, "0.000012"), (0, "0"),
     (None, "-"), (999.6, "1000"), (50.0, "50")],
)  # fmt: skip
def test_significant_has_three_digits_and_no_exponent(value, text):
    assert significant(value) == text


@pytest.mark.parametrize(
    ("write", "value", "text"),
    [(number, 1.23456, "1.2346"), (number, None, "-"), (scientific, 12345.0, "1.23e+04"),
     (scientific, None, "-")],
)  # fmt: skip
def test_numbers_are_formatted_as_in_the_paper(write, value, text):
    assert write(value) == text


@pytest.mark.parametrize(
    ("part", "html"),
    [
        (Heading(2, "A < B"), "<h2>A &lt; B</h2>"),
        (Paragraph("`a<b` is **not** c"), "<p><code>a&lt;b</code> is <strong>not</strong> c</p>"),
        (Code("a < b"), "<pre><code>a &lt; b</code></pre>"),
        (Bullets(("x", "y")), "<ul><li>x</li><li>y</li></ul>"),
        (
            Table("t", ("a", "b"), (("1", "2"),)),
            '<div class="scroll"><table><caption>t</caption><thead><tr><th>a</th><th>b</th></tr>'
            "</thead><tbody><tr><td>1</td><td>2</td></tr></tbody></table></div>",
        ),
    ],
)
def test_parts_become_elements(part, html):
    page = to_html([part], "a <title>", "a & b")
    assert f"<body>\n{html}\n</body>" in page
    assert "<title>a &lt;title&gt;</title>" in page
    assert 'content="a &amp; b"' in page
