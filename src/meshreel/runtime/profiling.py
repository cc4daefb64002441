"""Profiling: seconds by stage.

    with profiled() as profile:
        data = encode(sequence)
    print(profile.stages)

A stage is a block or a function; its overhead is negligible unless a profile is active. Stages
nest. Times of other threads are recorded separately: they overlap those of the caller's thread.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import wraps
from typing import ParamSpec, TypeVar

from meshreel.runtime.threads import fork_safe_lock

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
Path = tuple[str, ...]


@dataclass(frozen=True)
class StageTime:
    """Time spent in a stage.

    Attributes
    ----------
    path : tuple of str
        Names of the enclosing stages, outermost first, and its own name.
    in_other_thread : bool
        Whether it ran in another thread than the profile's.
    seconds : float
        Includes nested stages.
    """

    path: Path
    in_other_thread: bool
    seconds: float
    n_calls: int


class Profile:
    """Seconds by stage, from `profiled`."""

    def __init__(self) -> None:
        self._lock = fork_safe_lock()
        self._thread = threading.get_ident()
        self._start_s = time.perf_counter()
        self._wall_s: float | None = None
        self._times: dict[tuple[Path, bool], StageTime] = {}

    @property
    def wall_s(self) -> float:
        """Seconds from the start of the profile to its end, or to now."""
        if self._wall_s is None:
            return time.perf_counter() - self._start_s
        return self._wall_s

    @property
    def stages(self) -> list[StageTime]:
        """All stages by first start, each followed by its nested stages."""
        with self._lock:
            times = list(self._times.values())
        first = {stage.path: index for index, stage in reversed(list(enumerate(times)))}

        def sort_key(stage: StageTime) -> list[int]:
            ends = range(1, len(stage.path) + 1)
            return [first[stage.path[:end]] for end in ends] + [int(stage.in_other_thread)]

        return sorted(times, key=sort_key)

    @property
    def unnamed_s(self) -> float:
        """Seconds of the profile's thread outside of all stages."""
        outermost = [stage for stage in self.stages if len(stage.path) == 1]
        return self.wall_s - sum(stage.seconds for stage in outermost if not stage.in_other_thread)

    def end(self) -> None:
        """Stop the clock."""
        self._wall_s = time.perf_counter() - self._start_s

    def add(self, path: Path, seconds: float, n_calls: int) -> None:
        """Add seconds and calls of a stage, for the calling thread."""
        key = path, threading.get_ident() != self._thread
        with self._lock:
            before = self._times.get(key, StageTime(*key, 0.0, 0))
            self._times[key] = StageTime(*key, before.seconds + seconds, before.n_calls + n_calls)


_ACTIVE: ContextVar[tuple[Profile, Path] | None] = ContextVar("_ACTIVE", default=None)
"""The active profile, and the path of the current stage."""


@contextmanager
def profiled() -> Iterator[Profile]:
    """A context that profiles its body, including the work of our threads for it."""
    profile = Profile()
    token = _ACTIVE.set((profile, ()))
    try:
        yield profile
    finally:
        _ACTIVE.reset(token)
        profile.end()


@contextmanager
def stage(name: str) -> Iterator[None]:
    """A context whose body is a stage; the body must not contain a `yield`."""
    active = _ACTIVE.get()
    if active is None or active[1][-1:] == (name,):  # no profile, or already in this stage
        yield
        return
    profile, outer = active
    path = (*outer, name)
    profile.add(path, 0.0, 1)  # lists the stage before its nested stages
    token = _ACTIVE.set((profile, path))
    start_s = time.perf_counter()
    try:
        yield
    finally:
        profile.add(path, time.perf_counter() - start_s, 0)
        _ACTIVE.reset(token)


def staged(name: str) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """A decorator that makes a function a stage; not for generators."""

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @wraps(function)
        def timed(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            if _ACTIVE.get() is None:
                return function(*args, **kwargs)
            with stage(name):
                return function(*args, **kwargs)

        return timed

    return decorate
