"""IEEE single precision arithmetic on Python floats, which are double."""

from ctypes import c_float


def single(number):
    """Round to single precision, which also rounds one operation of two singles correctly."""
    return c_float(number).value
