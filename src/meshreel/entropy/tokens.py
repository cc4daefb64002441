"""The largest integer that can be coded."""

from meshreel.kernel.integers import MAX_MAGNITUDE

__all__ = ["MAX_MAGNITUDE"]
