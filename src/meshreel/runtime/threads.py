"""Independent pieces of array work on all cores.

NumPy releases the interpreter's lock while it computes, so threads can share arrays. Results do not
depend on the number of cores.

A forked child has none of these threads and starts its own. Locks that it may need come from
`fork_safe_lock`.

The threads of BLAS wait for each other by spinning: if other programs keep the cores busy, products
become many times slower. Pieces in our threads with one BLAS thread each are as fast on free cores,
and stay fast on busy ones.
"""

import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from contextvars import copy_context
from functools import cached_property, lru_cache, partial
from threading import RLock
from typing import Any, TypeVar
from weakref import WeakSet

import numpy as np
from threadpoolctl import ThreadpoolController

Piece = TypeVar("Piece")
Result = TypeVar("Result")

POOL = "meshreel-pool"
"""Prefix of the names of threads of the pool."""

MAX_AHEAD_PER_CORE = 4
"""Pieces that `results_in_order` submits before the oldest of them is complete, and pieces that
threads of the pool offer to idle ones."""

_LOCKS: WeakSet[Any] = WeakSet()


def fork_safe_lock() -> AbstractContextManager[bool]:
    """Return a reentrant lock that is free in a forked child unless the forking thread holds it.

    A fork copies only the thread that calls it. A lock that another thread holds at that moment
    would stay locked in the child, where no thread releases it.
    """
    lock = RLock()
    _LOCKS.add(lock)
    return lock


def _is_usable(lock: Any) -> bool:
    """Whether this thread can acquire the lock."""
    if lock.acquire(blocking=False):
        lock.release()
        return True
    return False


def _unlock_in_child() -> None:
    for lock in list(_LOCKS):
        if not _is_usable(lock):
            lock._at_fork_reinit()  # like locks of the standard library
    if sys.version_info < (3, 12):  # later versions of cached_property have no lock
        _unlock_cached_properties()


def _unlock_cached_properties() -> None:
    """Replace the locks of cached properties that other threads of the parent hold."""
    package = __name__.partition(".")[0]
    modules = [
        module
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == package and module is not None
    ]
    for module in modules:
        classes = [value for value in list(vars(module).values()) if isinstance(value, type)]
        for attribute in [value for owner in classes for value in list(vars(owner).values())]:
            is_property = isinstance(attribute, cached_property)
            lock = getattr(attribute, "lock", None) if is_property else None
            if lock is not None and not _is_usable(lock):
                attribute.lock = RLock()


def in_threads(
    work: Callable[[Piece], Result],
    pieces: Sequence[Piece],
    done: Callable[[int], None] | None = None,
) -> list[Result]:
    """Return the results of `work` for all pieces, which run in the pool with one BLAS thread each.

    The first error is raised. Calls from threads of the pool share its idle threads.

    Parameters
    ----------
    work : callable
        Called in any thread, with the caller's `numpy.errstate`.
    done : callable, optional
        Called in the caller's thread with n after the first n pieces are complete.
    """
    with one_blas_thread():
        if len(pieces) <= 1 or n_cores() == 1:
            results: Iterable[Result] = map(work, pieces)
        elif threading.current_thread().name.startswith(POOL):
            results = _with_idle_threads(work, pieces)
        else:
            tasks = [_in_caller_context(work) for _ in pieces]
            results = pool().map(lambda task, piece: task(piece), tasks, pieces)
        collected = []
        for result in results:
            collected.append(result)
            if done:
                done(len(collected))
        return collected


def _with_idle_threads(
    work: Callable[[Piece], Result], pieces: Sequence[Piece]
) -> Iterator[Result]:
    """Yield the result for each piece, which an idle thread of the pool computes, or the caller.

    The caller waits only for pieces that another thread has begun: threads of the pool that waited
    for each other's pieces to begin would wait forever. A busy pool keeps offers in its queue, so
    they are few, and hold their piece only until a thread claims it.
    """
    threads = pool()
    offers = [[partial(_in_caller_context(work), piece)] for piece in pieces]
    futures = [
        threads.submit(_accept, offer, threads.places)
        if threads.places.acquire(blocking=False)
        else None
        for offer in offers[1:]
    ]
    try:
        for offer, future in zip(offers, [None, *futures], strict=True):
            task = _claim(offer)
            if task is not None:
                yield task()
            else:
                assert future is not None
                yield future.result()  # type: ignore[misc]  # it claimed the piece
    finally:
        for offer in offers:
            offer.clear()


def _claim(offer: list[partial[Result]]) -> partial[Result] | None:
    """Return the task of an offer to the first caller, None to others."""
    try:
        return offer.pop()
    except IndexError:
        return None


def _accept(offer: list[partial[Result]], places: threading.Semaphore) -> Result | None:
    """Return the result of an offer, unless another thread has claimed it."""
    places.release()
    task = _claim(offer)
    return None if task is None else task()


def in_chunks(work: Callable[[slice], None], length: int, size: int) -> None:
    """Call `work` in the pool for the `chunks` of a length, as `in_threads`."""
    in_threads(work, chunks(length, size))


def results_in_order(
    work: Callable[[Piece], Result],
    pieces: Iterable[Piece],
    is_small: Callable[[Piece], bool],
) -> Iterator[Result]:
    """Yield the result of `work` for each piece; small pieces run in the pool, several ahead.

    Other pieces run in the caller's thread when all earlier ones are complete, so that they can use
    all cores themselves. An error is raised when its result is due; later pieces are canceled.
    """
    ahead: deque[Future[Result]] = deque()
    is_serial = n_cores() == 1 or threading.current_thread().name.startswith(POOL)
    with one_blas_thread():
        try:
            for piece in pieces:
                if is_serial or not is_small(piece):
                    while ahead:
                        yield ahead.popleft().result()
                    yield work(piece)
                    continue
                ahead.append(pool().submit(_in_caller_context(work), piece))
                while ahead and (ahead[0].done() or len(ahead) > MAX_AHEAD_PER_CORE * n_cores()):
                    yield ahead.popleft().result()
            while ahead:
                yield ahead.popleft().result()
        finally:
            for future in reversed(ahead):  # a piece may wait for an earlier one, never vice versa
                future.cancel()


def _in_caller_context(work: Callable[..., Result]) -> Callable[..., Result]:
    """Return a callable that does the work once, in any thread, with the context of this one.

    NumPy 2 stores `errstate` in the context, NumPy 1 in the thread.
    """
    context, errors = copy_context(), np.geterr()

    def with_errors(*arguments: Any) -> Result:
        with np.errstate(**errors):
            return work(*arguments)

    return partial(context.run, with_errors)


def chunks(length: int, size: int) -> list[slice]:
    """Slices of length `size` or less that cover 0..length."""
    return [slice(start, min(start + size, length)) for start in range(0, length, size)]


class _BlasLimit:
    """The limit of BLAS threads, shared by all callers; the last to leave removes it.

    One thread sets and removes it: OpenBLAS (tested: 0.3.30 and 0.3.31) obeys only the first thread
    that sets a limit, and silently ignores all others.
    """

    def __init__(self, limiter: Any = None) -> None:
        self._setter = ThreadPoolExecutor(1, "meshreel-limit")
        self.lock = RLock()
        self._n_holders = 0
        self.limiter = limiter  # None unless BLAS is limited

    def enter(self) -> None:
        with self.lock:
            if self.limiter is None:
                self.limiter = self._setter.submit(_limit_blas).result()
            self._n_holders += 1

    def leave(self) -> None:
        with self.lock:
            self._n_holders -= 1
            if not self._n_holders:
                self._setter.submit(self.limiter.restore_original_limits).result()
                self.limiter = None


def _limit_blas() -> Any:
    # SciPy loads its own BLAS, which a controller finds only if it is loaded.
    return _controller("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas")


_LIMIT = _BlasLimit()
_core_limit: int | None = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """A context in which BLAS uses one thread for each of our threads, and for the caller."""
    limit = _LIMIT
    limit.enter()
    try:
        yield
    finally:
        if limit is _LIMIT:  # a child forked within the context has a new limit
            limit.leave()


def limit_cores(limit: int | None) -> int | None:
    """Limit the cores that this process uses, if several processes share the machine; None: all.

    Returns
    -------
    int or None
        The limit before.
    """
    global _core_limit
    before = _core_limit
    if limit != before:
        _core_limit = limit
        pool.cache_clear()
    return before


class _Pool(ThreadPoolExecutor):
    def __init__(self) -> None:
        super().__init__(n_cores(), POOL)
        self.places = threading.Semaphore(MAX_AHEAD_PER_CORE * n_cores())


@lru_cache(maxsize=1)
def pool() -> _Pool:
    """The threads of `in_threads`, one per core; their names begin with `POOL`."""
    return _Pool()


def n_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        available = len(os.sched_getaffinity(0))
    else:
        available = os.cpu_count() or 1
    return min(available, _core_limit or available)


@lru_cache(maxsize=2)
def _controller(with_scipy: bool) -> ThreadpoolController:
    # threadpoolctl before 3.7 held the loader's lock while running Python: a deadlock with a thread
    # that imported a library, which needs that lock while it holds the interpreter's.
    return ThreadpoolController()


def _prepare_fork() -> None:
    # A fork while a limit is being set would leave the child unable to remove it.
    _LIMIT.lock.acquire()


def _resume_parent() -> None:
    _LIMIT.lock.release()


def _replace_in_child() -> None:
    """Replace the executors, whose threads exist only in the parent.

    A limit of BLAS threads set by the parent also applies in the child, where the first caller of
    `one_blas_thread` takes it over and removes it.
    """
    global _LIMIT
    _LIMIT = _BlasLimit(_LIMIT.limiter)
    pool.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_unlock_in_child)
    os.register_at_fork(
        before=_prepare_fork, after_in_parent=_resume_parent, after_in_child=_replace_in_child
    )
