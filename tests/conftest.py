"""Selection of the tests of a run, and the number of workers.

`pytest` alone takes about a minute and covers every module. It skips tests marked slow or real, and
folders that need other programs or real sequences. It runs only the first and the last case of a
parametrized test, unless that is marked every_case, and a tenth of the random cases.
`pytest --all` runs everything; so does a run that names files, folders or marks, within these.
"""

import gc
import re
import signal
from pathlib import Path

import pytest
from hypothesis import settings

from samples.costs import do_everything, draws

HERE = Path(__file__).parent
SKIPPED_FOLDERS = ("browser", "integration", "real")
"""Folders whose tests start browsers or Blender, or read real sequences."""

ALL_SLOW = re.compile(r"^pytestmark = (\[\s*)?pytest\.mark\.slow\b", re.MULTILINE)
"""Marks every test of a module slow."""

QUICK = (
    "quick tests. Skipped: tests marked slow or real, "
    f"tests/{{{','.join(SKIPPED_FOLDERS)}}}, all but two cases of a test, 90 % of random cases. "
    "`pytest --all` runs everything"
)
COSTLY = ("slow", "real")
MAX_WORKERS = 8

settings.register_profile("meshreel", deadline=None)  # speed is measured in bench/
settings.register_profile("quick", settings.get_profile("meshreel"), max_examples=draws(100))
settings.load_profile("meshreel")

# Shells make background jobs ignore ctrl-C, and their children inherit it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", dest="is_all", help="run slow tests too")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """Distribute tests over all cores; named tests run in this process unless `-n` is set."""
    option = config.option
    is_worker = hasattr(config, "workerinput")
    if is_worker or not hasattr(option, "numprocesses"):  # xdist is not installed
        return
    runs_here = option.file_or_dir or option.usepdb or option.trace or option.capture == "no"
    if option.numprocesses is None and not runs_here:
        option.numprocesses, option.maxprocesses = "auto", option.maxprocesses or MAX_WORKERS
    if option.numprocesses and option.dist == "no":
        option.dist = "worksteal"


def _is_quick(config):
    return not (config.option.is_all or config.option.file_or_dir or config.option.markexpr)


def pytest_configure(config):
    if _is_quick(config):
        settings.load_profile("quick")
    else:
        do_everything()


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session):
    """Report which tests are skipped."""
    config = session.config
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None:  # a worker
        return
    selected = "all tests" if config.option.is_all else "all named tests, including slow ones"
    reporter.write_line(f"meshreel: {QUICK if _is_quick(config) else selected}.")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Disable garbage collection, which would traverse all tests again and again.

    Collecting tests takes three fifths of the time without it.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path, config):
    """Skip folders and modules before they are imported."""
    if not _is_quick(config):
        return None
    if collection_path.parent == HERE and collection_path.name in SKIPPED_FOLDERS:
        return True
    is_module = collection_path.suffix == ".py"
    return True if is_module and ALL_SLOW.search(collection_path.read_text("utf-8")) else None


@pytest.hookimpl(wrapper=True)
def pytest_pycollect_makeitem(collector):
    """Skip tests and cases at collection; later steps are slow for ten thousand cases."""
    items = yield
    if not (isinstance(items, list) and _is_quick(collector.config)):
        return items
    kept = list(_quick(items))
    if len(kept) < len(items):
        skipped = [item for item in items if not any(item is other for other in kept)]
        collector.config.hook.pytest_deselected(items=skipped)
    return kept


def _quick(items):
    """Return the first and the last of the cheap cases of a test."""
    cases = [item for item in items if not any(item.get_closest_marker(mark) for mark in COSTLY)]
    if len(cases) < 3 or cases[0].get_closest_marker("every_case"):
        return cases
    return [cases[0], cases[-1]]


@pytest.fixture
def few_grid_lines(monkeypatch):
    """Sample surfaces on 64 lines along the longest side; 1024 take a second per frame."""
    from meshreel.metrics import surface_distance

    monkeypatch.setattr(surface_distance, "GRID_LINES", 64)
