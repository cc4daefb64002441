import pytest
from PIL import Image

from meshreel.rendering.documents import (
    Bullets,
    Code,
    Heading,
    Paragraph,
    Picture,
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
        (Code("a < b --c"), "<pre><code>a &lt; b <span>--c</span></code></pre>"),
        (Bullets(("x", "y")), "<ul><li>x</li><li>y</li></ul>"),
        (
            Table("t", ("a", "b"), (("1", "2"),)),
            '<div class="scroll"><table><caption><span>t</span></caption>'
            "<thead><tr><th>a</th><th>b</th></tr></thead>"
            "<tbody><tr><td>1</td><td>2</td></tr></tbody></table></div>",
        ),
        (
            Table("", ("a",), (("1 %",),)),
            '<div class="scroll"><table><thead><tr><th>a</th></tr></thead>'
            "<tbody><tr><td>1\N{NO-BREAK SPACE}%</td></tr></tbody></table></div>",
        ),
    ],
)
def test_parts_become_elements(part, html):
    page = to_html([part], "a <title>", "a & b")
    assert f"<body>\n{html}\n</body>" in page
    assert "<title>a &lt;title&gt;</title>" in page
    assert 'content="a &amp; b"' in page


@pytest.mark.parametrize(("dpi", "width"), [(120, 684), (240, 342), (None, 0)])
def test_pictures_scroll_below_the_width_at_which_text_of_8_points_has_8_pixels(
    dpi, width, tmp_path
):
    options = {} if dpi is None else {"dpi": (dpi, dpi)}
    Image.new("L", (1140, 4)).save(tmp_path / "a.png", **options)
    page = to_html([Picture(tmp_path / "a.png", "A", "Caption.", 1)], "title")
    assert f'style="min-width: {width}px"' in page
