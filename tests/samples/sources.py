"""Modules of Python as they are written."""


def statements(node):
    """All statements of a module or of one of its blocks; what is in expressions is passed over."""
    for field in ("body", "handlers", "orelse", "finalbody", "cases"):
        for inner in getattr(node, field, ()):
            yield inner
            yield from statements(inner)
