"""Every value of a JSON document, changed into odd ones."""

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
    """Every place of a JSON value, as keys and numbers to follow."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, below in items:
        yield (*path, key)
        if isinstance(below, dict | list):
            yield from places(below, (*path, key))


def changed(document, path, value):
    """The document with another value at a place."""
    document = copy.deepcopy(document)
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    if value is DELETED:
        del holder[path[-1]]
    else:
        holder[path[-1]] = value
    return document
