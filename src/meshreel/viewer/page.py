"""The page of the player, as the build of `web/` leaves it: one HTML file that needs no other."""

import base64
import hashlib
import re
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable

from meshreel.errors import InvalidInputError

PAGE: Traversable = files("meshreel.viewer") / "page" / "index.html"
MARKER = "<!--meshreel-data-->"
"""The place of the data in an exported page."""


def page_text(page: Traversable | None = None) -> str:
    """The HTML of the player.

    Parameters
    ----------
    page : Path or other traversable, optional
        Another page than that of the package.

    Raises
    ------
    InvalidInputError
        If it was not built; says how to get it.
    """
    try:
        return (PAGE if page is None else page).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InvalidInputError(
            "the page of the player is not built: run 'cd web && npm ci && npm run build' in the "
            "checkout, or install meshreel from a wheel"
        ) from None


def content_security_policy(page: str) -> str:
    """The page's policy: it may run its own scripts and ask its own server, and nothing else.

    Parameters
    ----------
    page : str
        Its HTML; scripts in it are allowed by their hashes.
    """
    hashes = " ".join(_hashes(page)) or "'none'"
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; "
        "img-src data: blob:; font-src data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def _hashes(page: str) -> Iterator[str]:
    as_read = page.replace("\r\n", "\n").replace("\r", "\n")
    for script in re.findall(
        r"<script\b[^>]*>(.*?)</script\s*>", as_read, re.DOTALL | re.IGNORECASE
    ):
        digest = hashlib.sha256(script.encode()).digest()
        yield f"'sha256-{base64.b64encode(digest).decode()}'"
