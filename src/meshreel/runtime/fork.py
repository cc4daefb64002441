"""Locks that a forked child can use.

A fork copies only the thread that calls it. A lock that another thread holds at that moment stays
locked in the child, where no thread releases it.
"""

import os
import sys
from functools import cached_property
from threading import RLock
from types import TracebackType
from typing import Any
from weakref import WeakSet


class ForkSafeLock:
    """A reentrant lock; a forked child inherits it unlocked, unless the forking thread holds it."""

    def __init__(self) -> None:
        self._lock = RLock()
        _LOCKS.add(self)

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._lock.release()

    def unlock_in_child(self) -> None:
        """Replace the lock if a thread of the parent holds it."""
        self._lock = _usable(self._lock)


_LOCKS: WeakSet[ForkSafeLock] = WeakSet()


def _usable(lock: Any) -> Any:
    """Return the lock if this thread can acquire it, else a new one."""
    if lock.acquire(blocking=False):
        lock.release()
        return lock
    return RLock()


def _unlock_in_child() -> None:
    for lock in list(_LOCKS):
        lock.unlock_in_child()
    if sys.version_info < (3, 12):  # later versions of cached_property have no lock
        _unlock_cached_properties()


def _unlock_cached_properties() -> None:
    """Replace the locks of our cached properties that threads of the parent were computing."""
    package = __name__.partition(".")[0]
    modules = [
        module
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == package and module is not None
    ]
    for module in modules:
        classes = [one for one in list(vars(module).values()) if isinstance(one, type)]
        for attribute in [one for owner in classes for one in list(vars(owner).values())]:
            if isinstance(attribute, cached_property) and hasattr(attribute, "lock"):
                attribute.lock = _usable(attribute.lock)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_unlock_in_child)
