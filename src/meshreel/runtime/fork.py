"""Locks that a forked child can use.

A fork copies only the thread that calls it. A lock that another thread holds at that moment stays
locked in the child, where no thread releases it.
"""

import os
import sys
from contextlib import AbstractContextManager
from functools import cached_property
from threading import RLock
from typing import Any
from weakref import WeakSet

_LOCKS: WeakSet[Any] = WeakSet()


def fork_safe_lock() -> AbstractContextManager[bool]:
    """A reentrant lock; a forked child inherits it unlocked, unless the forking thread holds it."""
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
            lock._at_fork_reinit()  # as the locks of the standard library are
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
            own = (
                getattr(attribute, "lock", None) if isinstance(attribute, cached_property) else None
            )
            if own is not None and not _is_usable(own):
                attribute.lock = RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_unlock_in_child)
