"""Fixtures: a browser, and files to play in it."""

from contextlib import ExitStack
from pathlib import Path

import pytest

import meshreel
from samples.browser import driven_browser
from samples.player_pages import put_to_rest, viewing, wait_for_player
from samples.tabs import Tab, Tabs
from samples.web_package import serving, three_files

SIZE = {"width": 800, "height": 500}
"""Default size of pages: rendering is in software, and larger pages take longer."""

ALLOWED_ERROR = 0.02
"""Small enough that some vertices need corrections, large enough that errors are visible."""


def pytest_collection_modifyitems(config, items):
    """Let tests in pages rerun once if reruns are enabled, as in `.ci/run`.

    Pages play in real time and are drawn without a GPU while other tests run.
    """
    if not config.getoption("reruns", 0):
        return
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.flaky(reruns=1, only_rerun=".*"))


@pytest.fixture(scope="package")
def browser():
    """A browser for all tests of this folder; its event loop would disturb other tests."""
    with driven_browser() as launched:
        yield launched


@pytest.fixture(scope="package")
def tabs(browser):
    """Tabs for all tests of this folder."""
    return Tabs(browser)


@pytest.fixture
def new_page(tabs):
    """Opens pages; script errors and WebGL errors fail the test."""

    def open_page(
        url,
        *,
        width=SIZE["width"],
        height=SIZE["height"],
        script="",
        routes=None,
        is_shown=True,
        is_at_rest=True,
    ):
        page = tabs.take(script, routes or {})
        page.set_viewport_size({"width": width, "height": height})
        page.goto(url)
        if is_shown:
            wait_for_player(page)
        if is_shown and is_at_rest:
            put_to_rest(page)
        return page

    yield open_page
    assert tabs.give_back() == []


@pytest.fixture
def three_page(new_page):
    """Opens a page that can import three.js and the package, with files by path."""
    with ExitStack() as servers:

        def open_page(files):
            url, _ = servers.enter_context(serving({**three_files(), **files}))
            return new_page(f"{url}/index.html", is_shown=False)

        yield open_page


@pytest.fixture(scope="module")
def kept_tabs():
    """Tabs by address, which stay open for all tests of a module."""
    kept = {}
    yield kept
    for tab in kept.values():
        tab.context.close()


@pytest.fixture
def shared_page(browser, kept_tabs):
    """Opens an address once per module; script errors fail the test.

    Tests find the first frame and no heat map. They change nothing else, unless each
    test that shares the address sets it first.
    """
    used = []

    def page_of(url):
        tab = kept_tabs.get(url)
        if tab is None or tab.is_gone or tab.errors:
            tab = kept_tabs[url] = Tab(browser, "", {}, is_webgl_watched=True)
            tab.page.set_viewport_size(SIZE)
            tab.page.goto(url)
            wait_for_player(tab.page)
        used.append(tab)
        put_to_rest(tab.page)
        return tab.page

    yield page_of
    assert [error for tab in used for error in tab.errors] == []


@pytest.fixture(scope="package")
def flag(tmp_path_factory):
    """A stream of three blocks with corrections, and its original."""
    folder = tmp_path_factory.mktemp("flag")
    sequence = meshreel.simulate_flag(36, n_rows=16, n_columns=18)
    meshreel.save(sequence, folder / "original.npz")
    data = meshreel.encode(sequence, max_error=ALLOWED_ERROR, effort=5, block_frames=12)
    (folder / "flag.reel").write_bytes(data)
    return folder


@pytest.fixture(scope="package")
def decoded(flag):
    """Frames of the stream, of shape (T, V, 3)."""
    return meshreel.decode((flag / "flag.reel").read_bytes()).vertices


@pytest.fixture(scope="package")
def url(browser, flag):
    """Address of a page that plays the stream."""
    with viewing(flag / "flag.reel") as (_, address):
        yield address


@pytest.fixture(scope="package")
def compared_url(browser, flag):
    """Address of a page that compares the stream with its original."""
    with viewing(flag / "flag.reel", "--original", flag / "original.npz") as (_, address):
        yield address
