"""Independent pieces of array work on all cores.

NumPy lets other threads run while it works, so that threads share arrays and cost little. Each
piece is computed as it would be alone: results do not depend on how many cores there are.

A forked child has none of these threads and starts its own. Locks that it may need come from
`fork_safe_lock`.

BLAS brings threads of its own, which wait for each other by spinning: where other programs keep
the cores busy, products become many times slower. Pieces in our threads with one BLAS thread each
are as fast where cores are free, and keep their speed where they are not.
"""

import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from contextvars import copy_context
from functools import cached_property, lru_cache, partial
from itertools import islice
from threading import RLock
from typing import Any, TypeVar
from weakref import WeakSet

import numpy as np
from threadpoolctl import ThreadpoolController

Piece = TypeVar("Piece")
Result = TypeVar("Result")

POOL, BACKGROUND = "meshreel-pool", "meshreel-background"
"""How the names of the threads of pieces, and of that in the background, begin."""

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
            lock._at_fork_reinit()  # as the standard library does with its own
    if sys.version_info < (3, 12):  # later versions of cached_property have no lock
        _unlock_cached_properties()


def _unlock_cached_properties() -> None:
    """Replace the locks of cached properties that other threads of the parent were computing."""
    package = __name__.partition(".")[0]
    modules = [
        module
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == package and module is not None
    ]
    for module in modules:
        classes = [one for one in list(vars(module).values()) if isinstance(one, type)]
        for attribute in [one for owner in classes for one in list(vars(owner).values())]:
            own = (
                getattr(attribute, "lock", None) if isinstance(attribute, cached_property) else None
            )
            if own is not None and not _is_usable(own):
                attribute.lock = RLock()


def in_threads(
    work: Callable[[Piece], None],
    pieces: Sequence[Piece],
    done: Callable[[int], None] | None = None,
) -> None:
    """Do the work for every piece, with one BLAS thread each; the first error is raised.

    A call from one of these threads is done in that thread: threads that all wait for a free one
    would wait for ever.

    Parameters
    ----------
    work : callable
        Called in any thread, with the caller's settings of `numpy.errstate`.
    done : callable, optional
        Called in the caller's thread with the number of pieces done from the first on.
    """
    with one_blas_thread():
        works = [_as_set_here(work) for _ in pieces]
        is_few = len(pieces) == 1 or n_cores() == 1
        is_alone = is_few or threading.current_thread().name.startswith(POOL)
        in_order = map if is_alone else pool().map
        results = in_order(lambda own, piece: own(piece), works, pieces)
        for number, _ in enumerate(results, start=1):
            if done:
                done(number)


def in_background(work: Callable[[], Result]) -> "Future[Result]":
    """The future result of work that begins in a thread of its own.

    There is one such thread. Work that it asks for itself is done at once: it cannot wait for
    itself. So is all work where there is one core.
    """
    if n_cores() > 1 and not threading.current_thread().name.startswith(BACKGROUND):
        return _background().submit(_as_set_here(work))
    done: Future[Result] = Future()
    try:
        done.set_result(work())
    except Exception as error:
        done.set_exception(error)
    return done


def one_ahead(items: Iterator[Result]) -> Iterator[Result]:
    """The items; the next one is made in a thread of its own while one is used."""

    def following() -> list[Result]:
        return list(islice(items, 1))

    with ThreadPoolExecutor(1, "meshreel-ahead") as ahead:
        coming = ahead.submit(_as_set_here(following))
        while found := coming.result():
            coming = ahead.submit(_as_set_here(following))
            yield found[0]


def _as_set_here(work: Callable[..., Result]) -> Callable[..., Result]:
    """The work, to be done once in any thread, with the settings of this one.

    NumPy 2 keeps the settings for its errors in the context, NumPy 1 in the thread.
    """
    context, errors = copy_context(), np.geterr()

    def with_errors(*arguments: Any) -> Result:
        with np.errstate(**errors):
            return work(*arguments)

    return partial(context.run, with_errors)


def chunks(length: int, size: int) -> list[slice]:
    """Slices of at most `size` that cover 0..length."""
    return [slice(start, min(start + size, length)) for start in range(0, length, size)]


class _Limit:
    """The limit of BLAS threads, shared by all callers that need it: the last to leave removes it.

    It is set and removed in a thread of its own: OpenBLAS (0.3.30 and 0.3.31 were tried) heeds
    only the thread that was the first to set one, and silently ignores all others.
    """

    def __init__(self, limiter: Any = None) -> None:
        self._setter = ThreadPoolExecutor(1, "meshreel-limit")
        self.lock = RLock()
        self._n_holders = 0
        self.limiter = limiter  # None unless BLAS is limited now

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
    return _controller().limit(limits=1, user_api="blas")


_LIMIT = _Limit()
_core_limit: int | None = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """A context in which BLAS uses one thread for each of our threads, and for the caller."""
    limit = _LIMIT
    limit.enter()
    try:
        yield
    finally:
        if limit is _LIMIT:  # else this is a child forked within the context: its limit is new
            limit.leave()


def limit_cores(limit: int) -> None:
    """Limit the cores of this process's threads from now on: it is one of several processes."""
    global _core_limit
    if limit != _core_limit:
        _core_limit = limit
        pool.cache_clear()


@lru_cache(maxsize=1)
def pool() -> ThreadPoolExecutor:
    """The threads that work on pieces, one per core; their names begin with `POOL`."""
    return ThreadPoolExecutor(n_cores(), POOL)


@lru_cache(maxsize=1)
def _background() -> ThreadPoolExecutor:
    # Apart from the pool: work in the background may use that.
    return ThreadPoolExecutor(1, BACKGROUND)


def n_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        there = len(os.sched_getaffinity(0))
    else:
        there = os.cpu_count() or 1
    return min(there, _core_limit or there)


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401  brings a BLAS of its own, which must be there to be found

    # Before 3.7 threadpoolctl held the loader's lock while it ran Python. A thread that imported a
    # library meanwhile, which needs that lock and keeps the interpreter's, made both wait for ever.
    return ThreadpoolController()


def _prepare_fork() -> None:
    # While a limit is being set, nobody could tell how to remove it in the child.
    _LIMIT.lock.acquire()


def _resume_parent() -> None:
    _LIMIT.lock.release()


def _replace_in_child() -> None:
    """Replace the executors, whose threads exist only in the parent.

    A limit of BLAS threads that the parent had set is in force in the child too. The first caller
    that needs it there takes it over and removes it.
    """
    global _LIMIT
    _LIMIT = _Limit(_LIMIT.limiter)
    pool.cache_clear()
    _background.cache_clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_unlock_in_child)
    os.register_at_fork(
        before=_prepare_fork, after_in_parent=_resume_parent, after_in_child=_replace_in_child
    )
