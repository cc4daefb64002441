"""Traversal of Python syntax trees."""


def statements(node):
    """Yield all statements of a module or block, except those in expressions."""
    for field in ("body", "handlers", "orelse", "finalbody", "cases"):
        for inner in getattr(node, field, ()):
            yield inner
            yield from statements(inner)
