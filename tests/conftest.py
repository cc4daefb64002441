"""What holds for all tests: which of them a run does, and on how many cores.

`pytest` alone takes about a minute and asserts each promise once. It leaves out what is marked slow
or real, and the folders that need other programs or real sequences; of a test with many cases it
runs the first and the last, unless it is marked every_case, and of cases that are drawn at random a
tenth. `pytest --all` does everything. A run that names files, folders or marks does all of these.
"""

import gc
import re
import signal
from pathlib import Path

import pytest
from hypothesis import settings

from samples.costs import do_everything, draws

HERE = Path(__file__).parent
LEFT_OUT = ("browser", "integration", "real")
"""Folders whose tests start browsers and Blender, or read the real sequences."""

ALL_SLOW = re.compile(r"^pytestmark = (\[\s*)?pytest\.mark\.slow\b", re.MULTILINE)
"""What marks every test of a module slow."""

MINUTE = (
    "the tests of a minute. Left out: what is marked slow or real, "
    f"tests/{{{','.join(LEFT_OUT)}}}, all but two cases of a test, nine tenths of random cases. "
    "`pytest --all` runs everything"
)
COSTLY = ("slow", "real")
MOST_WORKERS = 8

settings.register_profile("meshreel", deadline=None)  # speed is measured in bench/
settings.register_profile("minute", settings.get_profile("meshreel"), max_examples=draws(100))
settings.load_profile("meshreel")

# A shell has what it runs in the background ignore ctrl-C, and children of that inherit it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", dest="is_all", help="run slow tests too")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config):
    """All cores share the tests; what is named runs here, where a debugger works, unless `-n`."""
    option = config.option
    is_worker = hasattr(config, "workerinput")
    if is_worker or not hasattr(option, "numprocesses"):  # xdist is not there
        return
    is_watched = option.file_or_dir or option.usepdb or option.trace or option.capture == "no"
    if option.numprocesses is None and not is_watched:
        option.numprocesses, option.maxprocesses = "auto", option.maxprocesses or MOST_WORKERS
    if option.numprocesses and option.dist == "no":
        option.dist = "worksteal"


def _is_minute(config):
    return not (config.option.is_all or config.option.file_or_dir or config.option.markexpr)


def pytest_configure(config):
    if _is_minute(config):
        settings.load_profile("minute")
    else:
        do_everything()


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session):
    """Say first what is not run."""
    config = session.config
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None:  # a worker
        return
    named = "all tests" if config.option.is_all else "all tests that are named, slow ones too"
    reporter.write_line(f"meshreel: {MINUTE if _is_minute(config) else named}.")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Spare the garbage collector what stays: it would go through all tests while they are found.

    Collection takes three fifths of the time without it.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path, config):
    """Leave folders and modules out before anything in them is imported."""
    if not _is_minute(config):
        return None
    if collection_path.parent == HERE and collection_path.name in LEFT_OUT:
        return True
    is_module = collection_path.suffix == ".py"
    return True if is_module and ALL_SLOW.search(collection_path.read_text("utf-8")) else None


@pytest.hookimpl(wrapper=True)
def pytest_pycollect_makeitem(collector):
    """Leave out tests and cases where they are found: what follows takes long for ten thousand."""
    made = yield
    if not (isinstance(made, list) and _is_minute(collector.config)):
        return made
    kept = list(_quick(made))
    if len(kept) < len(made):
        left_out = [one for one in made if not any(one is other for other in kept)]
        collector.config.hook.pytest_deselected(items=left_out)
    return kept


def _quick(items):
    """Of the cases of a test those that are not costly, and of these the first and the last."""
    cases = [one for one in items if not any(one.get_closest_marker(mark) for mark in COSTLY)]
    if len(cases) < 3 or cases[0].get_closest_marker("every_case"):
        return cases
    return [cases[0], cases[-1]]
