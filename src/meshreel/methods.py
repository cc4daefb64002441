"""Registers the package that implements each method; it is imported on first use."""

from meshreel.codec.methods import Methods, register


def _reel() -> Methods:
    from meshreel.codec.reel.method import METHODS

    return METHODS


def _paper() -> Methods:
    from meshreel.runtime.extras import PAPER

    PAPER.load()
    from meshreel.paper.method import METHODS

    return METHODS


register(("reel", "lossless", "grid"), _reel)
register(("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft"), _paper)
