from meshreel.evaluation.pipeline import to_markdown
from meshreel.rendering.documents import Table, to_html


def test_tables_are_the_same_in_markdown_and_html(tmp_path):
    table = Table("T", ("a", "b|c"), (("x", "1 < 2"),))
    markdown = to_markdown([table], tmp_path)
    assert "| a | b\\|c |\n| --- | ---: |\n| x | 1 < 2 |" in markdown
    assert "<tr><td>x</td><td>1 &lt; 2</td></tr>" in to_html([table], "t")
