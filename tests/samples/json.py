"""JSON documents with each value replaced by unexpected ones."""

import copy
from typing import Any

ODD: list[Any] = [
    -1,
    0,
    1,
    3,
    1 << 31,
    1 << 70,
    0.5,
    1e308,
    -1e308,
    True,
    None,
    "x",
    "",
    [],
    {},
    [0],
    [{}],
]
DELETED = object()


def places(value, path=()):
    """Yield the path of every nested value, as keys and indices."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, below in items:
        yield (*path, key)
        if isinstance(below, dict | list):
            yield from places(below, (*path, key))


def changed(document, path, value):
    """Return the document with another value at a path, or without it."""
    document = copy.deepcopy(document)
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    if value is DELETED:
        del holder[path[-1]]
    else:
        holder[path[-1]] = value
    return document
