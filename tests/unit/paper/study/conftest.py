"""A small evaluation shared by the tests of this folder, and synthetic results."""

import pytest

from meshreel.model.flag import simulate_flag
from meshreel.paper.study.study import PaperStudy
from meshreel.studies.study import evaluate


@pytest.fixture(scope="session")
def flag():
    return simulate_flag(12, n_rows=10, n_columns=12)


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("report")


@pytest.fixture(scope="session")
def evaluation(flag, folder):
    return evaluate(PaperStudy(quick=True), [flag], folder, command="meshreel paper --frames 12")


@pytest.fixture(scope="session")
def results(evaluation):
    return evaluation.measured[0][0]


@pytest.fixture(scope="session")
def pictures(evaluation):
    return evaluation.measured[0][1]
