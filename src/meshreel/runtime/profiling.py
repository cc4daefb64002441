"""Where the time goes: seconds by stage, for whoever listens.

    with profiled() as profile:
        data = encode(sequence)
    print(profile.stages)

Stages mark themselves, as blocks or as whole functions, and cost nothing worth measuring where
nobody listens. A stage that begins within another is a part of it. What other threads do meanwhile
is kept apart: its seconds run beside those of the caller's thread and do not add up with them.
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
    """Time that a stage took.

    Attributes
    ----------
    path : tuple of str
        The stages that it is a part of, from the outermost on, and its own name.
    is_beside : bool
        Whether other threads than the listener's did it.
    seconds : float
        Parts included.
    """

    path: Path
    is_beside: bool
    seconds: float
    n_calls: int


class Profile:
    """Seconds by stage, from `profiled`."""

    def __init__(self) -> None:
        self._lock = fork_safe_lock()
        self._thread = threading.get_ident()
        self._began_s = time.perf_counter()
        self._wall_s: float | None = None
        self._times: dict[tuple[Path, bool], StageTime] = {}

    @property
    def wall_s(self) -> float:
        """Seconds between the beginning of the profile and its end, or now."""
        if self._wall_s is None:
            return time.perf_counter() - self._began_s
        return self._wall_s

    @property
    def stages(self) -> list[StageTime]:
        """Every stage as it first began, its parts behind it."""
        with self._lock:
            times = list(self._times.values())
        first = {stage.path: place for place, stage in reversed(list(enumerate(times)))}

        def place(stage: StageTime) -> list[int]:
            ends = range(1, len(stage.path) + 1)
            return [first[stage.path[:end]] for end in ends] + [int(stage.is_beside)]

        return sorted(times, key=place)

    @property
    def unnamed_s(self) -> float:
        """Seconds of the listener's thread that belong to no stage."""
        outermost = [stage for stage in self.stages if len(stage.path) == 1]
        return self.wall_s - sum(stage.seconds for stage in outermost if not stage.is_beside)

    def end(self) -> None:
        """Stop the clock."""
        self._wall_s = time.perf_counter() - self._began_s

    def add(self, path: Path, seconds: float, n_calls: int) -> None:
        """Count seconds and calls of a stage for the thread that asks."""
        key = path, threading.get_ident() != self._thread
        with self._lock:
            before = self._times.get(key, StageTime(*key, 0.0, 0))
            self._times[key] = StageTime(*key, before.seconds + seconds, before.n_calls + n_calls)


_OPEN: ContextVar[tuple[Profile, Path] | None] = ContextVar("_OPEN", default=None)
"""Who listens, and the stages that are going on."""


@contextmanager
def profiled() -> Iterator[Profile]:
    """A context that gives a profile of its body, and of work that our threads do for it."""
    profile = Profile()
    token = _OPEN.set((profile, ()))
    try:
        yield profile
    finally:
        _OPEN.reset(token)
        profile.end()


@contextmanager
def stage(name: str) -> Iterator[None]:
    """A context whose body is a stage of this name; it must not yield to its caller in between."""
    listening = _OPEN.get()
    if listening is None or listening[1][-1:] == (name,):  # or it is going on already
        yield
        return
    profile, outer = listening
    path = (*outer, name)
    profile.add(path, 0.0, 1)  # so that it stands before its parts
    token = _OPEN.set((profile, path))
    start_s = time.perf_counter()
    try:
        yield
    finally:
        profile.add(path, time.perf_counter() - start_s, 0)
        _OPEN.reset(token)


def staged(name: str) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """A decorator: the function, not a generator, is a stage of this name."""

    def decorate(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @wraps(function)
        def timed(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
            if _OPEN.get() is None:  # nobody listens
                return function(*args, **kwargs)
            with stage(name):
                return function(*args, **kwargs)

        return timed

    return decorate
