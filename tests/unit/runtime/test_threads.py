"""Work in threads: pieces, results in order, BLAS threads."""

import subprocess
import sys
import threading
import time
import warnings
import weakref

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from meshreel.runtime.threads import chunks, in_threads, n_cores, one_blas_thread, results_in_order

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
    _controller.__wrapped__(True)
"""
"""Imports libraries in one thread, while another searches for BLAS libraries."""


def blas_threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


@pytest.mark.parametrize(("cpu_count", "expected"), [(7, 7), (None, 1)])
def test_cores_are_those_of_the_machine_without_affinity(monkeypatch, cpu_count, expected):
    monkeypatch.delattr("os.sched_getaffinity", raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: cpu_count)
    assert n_cores() == expected


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
def test_error_of_a_piece_is_raised(n_pieces):
    def work(piece):
        if piece == n_pieces // 2:
            raise LookupError(f"piece {piece}")

    with pytest.raises(LookupError, match=f"piece {n_pieces // 2}"):
        in_threads(work, range(n_pieces))
    in_threads(work, range(n_pieces // 2))  # the threads still work


def test_first_error_is_raised_when_several_pieces_fail():
    def work(piece):
        if piece in (3, 4, 7):
            time.sleep(0.02 if piece == 3 else 0)
            raise LookupError(f"piece {piece}")

    reported = []
    with pytest.raises(LookupError, match="piece 3"):
        in_threads(work, range(9), reported.append)
    assert reported == [1, 2, 3]


@pytest.mark.every_case
@pytest.mark.parametrize("n_pieces", [1, 8])
def test_errors_of_numpy_are_ignored_or_raised_as_by_the_caller(n_pieces):
    def work(piece):
        np.float64(1e300) * np.float64(10.0**300)

    with np.errstate(over="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        in_threads(work, range(n_pieces))
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        in_threads(work, range(n_pieces))


def test_numpy_settings_of_a_piece_are_local():
    def work(piece):
        assert np.geterr()["divide"] == "warn"
        np.seterr(divide="ignore")

    with np.errstate(divide="warn"):
        in_threads(work, range(20))
        assert np.geterr()["divide"] == "warn"


@pytest.mark.parametrize("size", [1, 3, 64, 1000])
def test_result_does_not_depend_on_the_piece_size(size):
    values = np.random.default_rng(0).normal(size=(500, 20))
    result = np.empty_like(values)

    def work(piece):
        result[piece] = np.sin(values[piece]) * 3 + values[piece] ** 2

    in_threads(work, chunks(500, size))
    np.testing.assert_array_equal(result, np.sin(values) * 3 + values**2)


@pytest.mark.parametrize("n_pieces", [1, 6])
def test_blas_has_one_thread_during_pieces_only(n_pieces):
    before, inside = blas_threads(), []
    in_threads(lambda piece: inside.append(blas_threads()), range(n_pieces))
    assert inside == [[1] * len(before)] * n_pieces
    assert blas_threads() == before


def test_nested_pieces_are_done_when_all_threads_are_busy():
    n_pieces, done = 3 * n_cores(), []

    def work(piece):
        in_threads(lambda inner: done.append((piece, inner)), range(5))

    in_threads(work, range(n_pieces))
    assert sorted(done) == [(piece, inner) for piece in range(n_pieces) for inner in range(5)]


@pytest.mark.skipif(n_cores() == 1, reason="no thread is idle")
def test_nested_pieces_also_run_in_idle_threads():
    meeting = threading.Barrier(2, timeout=60)

    def work(is_nested):
        return in_threads(lambda _: meeting.wait(), range(2)) if is_nested else []

    nested, other = in_threads(work, [True, False])
    assert (sorted(nested), other) == ([0, 1], [])


def test_nested_pieces_are_released_when_all_threads_are_busy():
    all_are_busy, are_alive = threading.Barrier(n_cores(), timeout=60), []

    def work(_):
        all_are_busy.wait()
        pieces = [np.zeros(1) for _ in range(5)]
        references = [*map(weakref.ref, pieces)]
        in_threads(len, pieces)
        del pieces
        are_alive.extend(reference() is not None for reference in references)
        all_are_busy.wait()

    in_threads(work, range(n_cores()))
    assert not any(are_alive)


def test_first_error_of_nested_pieces_is_raised():
    def fail(piece):
        if piece > 1:
            raise ValueError(f"piece {piece}")
        return piece

    def work(_):
        with pytest.raises(ValueError, match="piece 2"):
            in_threads(fail, range(5))

    in_threads(work, range(2 * n_cores()))


def test_one_blas_thread_applies_in_every_thread():
    before, inside = blas_threads(), []

    def ask():
        with one_blas_thread():
            inside.append(blas_threads())

    for _ in range(2):
        ask()
        asking = threading.Thread(target=ask)
        asking.start()
        asking.join()
    assert inside == [[1] * len(before)] * 4
    assert blas_threads() == before


def test_blas_threads_are_restored_after_an_error():
    before, inside = blas_threads(), []

    def fail():
        with one_blas_thread():
            inside.append(blas_threads())
            raise LookupError

    with pytest.raises(LookupError):
        fail()
    assert inside == [[1] * len(before)]
    assert blas_threads() == before


@pytest.mark.slow
def test_libraries_of_blas_are_found_when_another_thread_imports_libraries(tmp_path):
    subprocess.run([sys.executable, "-c", IMPORTING, tmp_path], check=True, timeout=60)


@pytest.mark.parametrize(("length", "size"), [(0, 3), (1, 3), (6, 3), (7, 3), (5, 100)])
def test_chunks_cover_the_length_in_order(length, size):
    pieces = chunks(length, size)
    covered = [index for piece in pieces for index in range(piece.start, piece.stop)]
    assert covered == list(range(length))
    assert all(1 <= piece.stop - piece.start <= size for piece in pieces)


@pytest.mark.parametrize("n_pieces", COUNTS)
def test_results_are_in_the_order_of_pieces_that_end_in_another(n_pieces):
    def square(number):
        time.sleep(0.002 * (number % 3 == 0))
        return number**2

    results = results_in_order(square, range(n_pieces), lambda number: number % 7 != 3)
    assert list(results) == [number**2 for number in range(n_pieces)]


def test_large_pieces_run_in_the_caller_when_earlier_ones_are_complete():
    complete = []

    def work(number):
        earlier, thread = list(complete), threading.current_thread()
        complete.append(number)
        return earlier, thread

    results = list(results_in_order(work, range(9), lambda number: number != 6))
    earlier, thread = results[6]
    assert sorted(earlier) == list(range(6))
    assert thread is threading.current_thread()


def test_pieces_are_taken_as_results_are_used():
    taken = []

    def pieces():
        for number in range(1000):
            taken.append(number)
            yield number

    results = results_in_order(lambda number: number, pieces(), lambda _: True)
    assert next(results) == 0
    assert len(taken) <= 10 * n_cores()


def test_error_of_a_piece_is_raised_after_the_results_before_it():
    started = []

    def work(number):
        started.append(number)
        if number == 2:
            raise ValueError("piece 2")
        return number

    results = results_in_order(work, range(1000), lambda _: True)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ValueError, match="piece 2"):
        next(results)
    assert max(started) <= 10 * n_cores()


def test_nested_pieces_run_in_their_thread():
    def work(number):
        return sum(results_in_order(lambda item: item, range(number), lambda _: True))

    sums = results_in_order(work, range(20), lambda _: True)
    assert list(sums) == [number * (number - 1) // 2 for number in range(20)]
