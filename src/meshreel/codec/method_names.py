"""Names of the encoding methods, and their codes in a stream."""

from meshreel.errors import UnsupportedVersionError

METHOD_CODES = {
    "pca-qp": 0,
    "pca": 1,
    "pca-q": 2,
    "v2v": 3,
    "pca-qs": 4,
    "blocks": 5,
    "gft": 6,
    "reel": 7,
    "lossless": 8,
    "grid": 9,
}
"""Codes of the methods in a stream, by name."""

METHOD_NAMES = tuple(METHOD_CODES)

LOSSLESS = "lossless"


def our_name(name: str) -> str:
    """Return our name of a method, which may be given by its name in the paper, as in "PCA+qp"."""
    plain = str(name).lower().replace("+", "-").replace(" ", "-")
    plain = "gft" if plain == "per-mesh" else plain
    return plain if plain in METHOD_CODES else name


def name_of_code(code: int) -> str:
    """Return the name of the method of this code; raises UnsupportedVersionError if unknown."""
    for name, known in METHOD_CODES.items():
        if code == known:
            return name
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")
