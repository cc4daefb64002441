"""Pieces of work in threads."""

import subprocess
import sys
import threading
import time
import warnings

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from meshreel.runtime.threads import (
    chunks,
    in_background,
    in_threads,
    n_cores,
    one_blas_thread,
    prefetch,
)

COUNTS = [0, 1, 2, 3, 50]

IMPORTING = """
import importlib.util, shutil, sys, threading
from importlib.machinery import ExtensionFileLoader
from pathlib import Path
import scipy.linalg
from meshreel.runtime.threads import _controller

folder, modules = Path(sys.argv[1]), ("_queue", "_opcode", "_json", "_bisect")
libraries = [importlib.util.find_spec(name).origin for name in modules]
library = next(one for one in libraries if one.endswith((".so", ".pyd")))
module = Path(library).name.partition(".")[0]

def import_copies():
    for number in range(120):
        name, copy = f"copy{number}.{module}", shutil.copy(library, folder / f"{number}.so")
        loader = ExtensionFileLoader(name, str(copy))
        spec = importlib.util.spec_from_file_location(name, copy, loader=loader)
        importlib.util.module_from_spec(spec)

sys.setswitchinterval(1e-6)
importing = threading.Thread(target=import_copies, daemon=True)
importing.start()
while importing.is_alive():
    _controller.__wrapped__()
"""
"""Imports libraries in one thread, and looks for those of BLAS in another."""


def blas_threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


@pytest.mark.parametrize(("counted", "found"), [(7, 7), (None, 1)])
def test_cores_are_those_of_the_machine_when_a_process_cannot_tell(monkeypatch, counted, found):
    monkeypatch.delattr("os.sched_getaffinity", raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: counted)
    assert n_cores() == found


@pytest.mark.parametrize("n_pieces", COUNTS)
def test_every_piece_is_done_once_whatever_their_number(n_pieces):
    done = []
    in_threads(done.append, range(n_pieces))
    assert sorted(done) == list(range(n_pieces))


@pytest.mark.parametrize("n_pieces", COUNTS)
def test_progress_counts_up_when_pieces_end_in_another_order(n_pieces):
    finished, reported, reporters = [], [], set()

    def work(piece):
        time.sleep(0.002 * ((n_pieces - piece) % 3))
        finished.append(piece)

    def done(number):
        assert set(range(number)) <= set(finished)
        reported.append(number)
        reporters.add(threading.get_ident())

    in_threads(work, range(n_pieces), done)
    assert reported == list(range(1, n_pieces + 1))
    assert reporters <= {threading.get_ident()}


@pytest.mark.parametrize("n_pieces", [1, 9])
def test_error_comes_out_when_a_piece_fails(n_pieces):
    def work(piece):
        if piece == n_pieces // 2:
            raise LookupError(f"piece {piece}")

    with pytest.raises(LookupError, match=f"piece {n_pieces // 2}"):
        in_threads(work, range(n_pieces))
    in_threads(work, range(n_pieces // 2))  # threads are there for what comes after


def test_first_error_comes_out_when_several_pieces_fail():
    def work(piece):
        if piece in (3, 4, 7):
            time.sleep(0.02 if piece == 3 else 0)
            raise LookupError(f"piece {piece}")

    reported = []
    with pytest.raises(LookupError, match="piece 3"):
        in_threads(work, range(9), reported.append)
    assert reported == [1, 2, 3]


@pytest.mark.parametrize("n_pieces", [1, 8])
def test_errors_of_numpy_are_ignored_when_the_caller_ignores_them(n_pieces):
    def work(piece):
        np.float64(1e300) * np.float64(10.0**300)

    with np.errstate(over="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        in_threads(work, range(n_pieces))


@pytest.mark.parametrize("n_pieces", [1, 8])
def test_errors_of_numpy_are_raised_when_the_caller_raises_them(n_pieces):
    def work(piece):
        np.float64(1e300) * np.float64(10.0**300)

    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        in_threads(work, range(n_pieces))


def test_what_a_piece_sets_for_numpy_stays_with_it():
    def work(piece):
        assert np.geterr()["divide"] == "warn"
        np.seterr(divide="ignore")

    with np.errstate(divide="warn"):
        in_threads(work, range(20))
        assert np.geterr()["divide"] == "warn"


@pytest.mark.parametrize("size", [1, 3, 64, 1000])
def test_result_is_the_same_whatever_the_pieces(size):
    """Bit by bit, where a piece is computed as it would be alone."""
    values = np.random.default_rng(0).normal(size=(500, 20))
    result = np.empty_like(values)

    def work(piece):
        result[piece] = np.sin(values[piece]) * 3 + values[piece] ** 2

    in_threads(work, chunks(500, size))
    np.testing.assert_array_equal(result, np.sin(values) * 3 + values**2)


@pytest.mark.parametrize("n_pieces", [1, 6])
def test_blas_has_one_thread_while_pieces_are_done_and_as_many_as_before_after(n_pieces):
    before, found = blas_threads(), []
    in_threads(lambda piece: found.append(blas_threads()), range(n_pieces))
    assert found == [[1] * len(before)] * n_pieces
    assert blas_threads() == before


def test_pieces_of_pieces_are_done_when_all_threads_are_at_work():
    n_pieces, done = 3 * n_cores(), []

    def work(piece):
        in_threads(lambda inner: done.append((piece, inner)), range(5))

    in_threads(work, range(n_pieces))
    assert sorted(done) == [(piece, inner) for piece in range(n_pieces) for inner in range(5)]


def test_blas_has_one_thread_wherever_that_is_asked_for():
    before, found = blas_threads(), []

    def ask():
        with one_blas_thread():
            found.append(blas_threads())

    for _ in range(2):
        ask()
        asking = threading.Thread(target=ask)
        asking.start()
        asking.join()
    assert found == [[1] * len(before)] * 4
    assert blas_threads() == before


def test_blas_has_as_many_threads_as_before_when_something_fails():
    before, found = blas_threads(), []

    def fail():
        with one_blas_thread():
            found.append(blas_threads())
            raise LookupError

    with pytest.raises(LookupError):
        fail()
    assert found == [[1] * len(before)]
    assert blas_threads() == before


def test_work_goes_on_beside_the_caller_when_it_is_in_the_background():
    """Each waits for the other, which ends only if both are at work."""
    from_caller, from_work = threading.Event(), threading.Event()

    def work():
        from_work.set()
        return from_caller.wait(10), threading.get_ident()

    future = in_background(work)
    assert from_work.wait(10)
    from_caller.set()
    was_heard, thread = future.result(10)
    assert was_heard
    assert thread != threading.get_ident()


@pytest.mark.slow
def test_libraries_of_blas_are_found_when_another_thread_imports_libraries(tmp_path):
    subprocess.run([sys.executable, "-c", IMPORTING, tmp_path], check=True, timeout=60)


def test_error_comes_out_with_the_result_when_work_in_the_background_fails():
    def fail():
        raise LookupError("in the background")

    future = in_background(fail)
    with pytest.raises(LookupError, match="in the background"):
        future.result(10)
    assert in_background(lambda: 7).result(10) == 7  # the thread is there for what comes after


def test_background_does_its_own_work_at_once_when_it_asks_for_more_itself():
    assert in_background(lambda: in_background(lambda: 7).result(10)).result(10) == 7


def test_error_comes_out_with_the_result_when_the_background_asks_for_more():
    def fail():
        raise LookupError("inner")

    future = in_background(lambda: in_background(fail))
    with pytest.raises(LookupError, match="inner"):
        future.result(10).result(10)


def test_pieces_of_the_background_and_of_the_caller_are_all_done_when_both_use_threads():
    """More pieces than there are threads: neither waits for a thread that the other holds."""
    behind, before = [], []
    futures = [in_background(lambda: in_threads(behind.append, range(100))) for _ in range(3)]
    in_threads(before.append, range(100))
    for future in futures:
        future.result(10)
    assert sorted(behind) == sorted([*range(100)] * 3)
    assert sorted(before) == list(range(100))


def test_background_has_what_the_caller_set_for_numpy_when_it_was_asked():
    def work():
        found = np.geterr()["divide"]
        np.seterr(divide="print")
        return found

    with np.errstate(divide="ignore"):
        future = in_background(work)
    assert future.result(10) == "ignore"
    with np.errstate(divide="raise"):
        assert in_background(work).result(10) == "raise"
        assert np.geterr()["divide"] == "raise"


@pytest.mark.parametrize(("length", "size"), [(0, 3), (1, 3), (6, 3), (7, 3), (5, 100)])
def test_chunks_cover_the_length_one_after_another(length, size):
    pieces = chunks(length, size)
    covered = [place for piece in pieces for place in range(piece.start, piece.stop)]
    assert covered == list(range(length))
    assert all(1 <= piece.stop - piece.start <= size for piece in pieces)


def test_cores_are_at_least_one():
    assert n_cores() >= 1


def test_items_come_in_order_when_they_are_made_ahead():
    made, used = [], []

    def items():
        for number in range(5):
            made.append(number)
            yield number

    for number in prefetch(items()):
        wanted = list(range(min(number + 2, 5)))
        end = time.monotonic() + 20.0  # on busy cores the thread starts late
        while len(made) < len(wanted) and time.monotonic() < end:
            time.sleep(0.001)
        time.sleep(0.02)  # time to make more than one ahead
        assert made == wanted
        used.append(number)
    assert used == list(range(5))


def test_an_error_is_raised_when_an_item_made_ahead_fails():
    def items():
        yield 1
        raise ValueError("no second item")

    found = prefetch(items())
    assert next(found) == 1
    with pytest.raises(ValueError, match="no second item"):
        next(found)
