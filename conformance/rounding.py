"""IEEE single precision by Python's floats, which are double."""

from ctypes import c_float


def single(number):
    """The nearest float of single precision; of a single operation of two of them, its result."""
    return c_float(number).value
