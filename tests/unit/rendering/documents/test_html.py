import pytest

from meshreel.rendering.documents.html import to_html
from meshreel.rendering.documents.parts import Bullets, Code, Heading, Paragraph, Table


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
