"""The page of the package, and what a browser lets it do."""

import base64
import hashlib

import pytest

from meshreel.errors import InvalidInputError
from meshreel.viewer.page import content_security_policy, page_text


def hash_of(script):
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def test_page_is_read_when_it_is_there(tmp_path):
    (tmp_path / "index.html").write_text("<html>\u00e9</html>", encoding="utf-8")
    assert page_text(tmp_path / "index.html") == "<html>\u00e9</html>"


def test_error_says_how_to_get_the_page_when_it_is_not_built(tmp_path):
    with pytest.raises(InvalidInputError, match=r"npm ci && npm run build.*wheel"):
        page_text(tmp_path / "index.html")


@pytest.mark.parametrize(
    ("page", "scripts"),
    [
        ("<script>a()</script>", ["a()"]),
        ('<script type="module" crossorigin>\nif (1 < 2) x = "</b>"\n</script>',
         ['\nif (1 < 2) x = "</b>"\n']),
        ("<SCRIPT>a</SCRIPT ><p></p><script>\r\nb\r</script>", ["a", "\nb\n"]),
        ("<script></script>", [""]),
    ],
)  # fmt: skip
def test_policy_allows_the_scripts_of_the_page_when_it_has_some(page, scripts):
    policy = content_security_policy(page)
    assert f"script-src {' '.join(map(hash_of, scripts))};" in policy
    assert policy.startswith("default-src 'none';")


def test_policy_allows_no_script_when_the_page_has_none():
    assert "script-src 'none';" in content_security_policy("<p>script</p>")
