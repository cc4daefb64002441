"""A pytest plugin that records which test executes which line, or runs only listed tests."""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

RECORD, SELECT = "MUTATION_RECORD", "MUTATION_SELECT"
"""Environment variables: the folder to record in; the file with the names of tests to keep."""

LINES, SECONDS = "lines", "seconds.json"
"""Files of the record: the data of `coverage`, with tests as contexts; seconds by test."""


class Recorder:
    """Records the lines of each test that passes, and how long it takes."""

    def __init__(self, folder: Path) -> None:
        import coverage  # type: ignore[import-not-found, unused-ignore]

        self.folder = folder
        self.seconds: dict[str, float] = {}
        self.failed: set[str] = set()
        self.coverage = coverage.Coverage(
            data_file=str(folder / LINES), source=["src/meshreel"], config_file=False
        )
        self.coverage.set_option("run:relative_files", True)
        self.coverage.start()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Time a test, and record its lines under its name."""
        self.coverage.switch_context(item.nodeid)
        start = time.monotonic()
        result = yield
        self.seconds[item.nodeid] = time.monotonic() - start
        self.coverage.switch_context("")
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Remember tests that fail: they would fail for every mutant."""
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_unconfigure(self) -> None:
        """Store the record."""
        self.coverage.stop()
        self.coverage.save()
        passed = {name: second for name, second in self.seconds.items() if name not in self.failed}
        (self.folder / SECONDS).write_text(json.dumps(passed))


class Selector:
    """Runs only the tests of a list, in its order."""

    def __init__(self, listed: Path) -> None:
        self.order = {name: at for at, name in enumerate(json.loads(listed.read_text()))}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Remove all tests that are not listed."""
        kept = [item for item in items if item.nodeid in self.order]
        items[:] = sorted(kept, key=lambda item: self.order[item.nodeid])


def pytest_configure(config: pytest.Config) -> None:
    """Record or select tests, depending on the environment."""
    if RECORD in os.environ:
        config.pluginmanager.register(Recorder(Path(os.environ[RECORD])))
    if SELECT in os.environ:
        config.pluginmanager.register(Selector(Path(os.environ[SELECT])))
