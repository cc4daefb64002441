"""A small writer of EnSight Gold files, from the format in the EnSight User Manual."""

import numpy as np

FORMATS = ["text", "<", ">"]
"""Text, or C binary of a byte order."""


def lines(form, *texts):
    """The bytes of lines."""
    if form == "text":
        return "".join(f"{text}\n" for text in texts).encode()
    return b"".join(text.encode().ljust(80, b"\0") for text in texts)


def table(form, values):
    """The bytes of integers or floats, with a line of text for each row."""
    values = np.asarray(values)
    is_float = values.dtype.kind == "f"
    if form == "text":
        rows = values.reshape(len(values), -1).tolist()
        pattern = "{:12.5e}" if is_float else "{:10d}"
        return "".join("".join(map(pattern.format, row)) + "\n" for row in rows).encode()
    return values.astype(f"{form}{'f4' if is_float else 'i4'}").tobytes()


def column(form, values):
    """The bytes of the components of values of shape (N,) or (N, C), one after the other."""
    values = np.asarray(values, float)
    return table(form, values.reshape(len(values), -1).T.ravel())


def block(form, kind, nodes, *, numbers=False, sizes=()):
    """The bytes of elements, with nodes from 0; sizes are tables between number and nodes."""
    count = len(sizes[0]) if sizes else len(nodes)
    result = lines(form, kind) + table(form, [count])
    result += table(form, range(7, 7 + count)) if numbers else b""
    result += b"".join(table(form, size) for size in sizes)
    if sizes:  # rows of different lengths
        return result + b"".join(table(form, np.array([row]) + 1) for row in nodes)
    return result + table(form, np.asarray(nodes) + 1)


def part(form, number, name, points, *blocks, numbers=False):
    """The bytes of a part."""
    result = lines(form, "part") + table(form, [number]) + lines(form, name, "coordinates")
    result += table(form, [len(points)])
    result += table(form, range(5, 5 + len(points))) if numbers else b""
    return result + (column(form, points) if len(points) else b"") + b"".join(blocks)


def geometry(form, *parts, numbers="off", extents=False):
    """The bytes of a geometry file."""
    first = [] if form == "text" else ["C Binary"]
    result = lines(form, *first, "small", "example", f"node id {numbers}", f"element id {numbers}")
    if extents:
        result += lines(form, "extents") + table(form, np.zeros((3, 2)))
    return result + b"".join(parts)


def variable(form, *parts):
    """The bytes of a variable file; each part is (number, {kind: values}).

    Values of kinds that end in "undef" begin with the value that means none.
    """
    result = lines(form, "values")
    for number, tables in parts:
        result += lines(form, "part") + table(form, [number])
        for kind, values in tables.items():
            result += lines(form, kind)
            if kind.endswith("undef"):
                result += table(form, [float(values[0])])
                values = values[1]
            result += column(form, values)
    return result


def case(model, variables=(), times=(), more=""):
    """The text of a case file with the time set 1."""
    result = f"FORMAT\ntype: ensight gold\n\nGEOMETRY\nmodel: {model}\n"
    result += "VARIABLE\n" + "".join(f"{line}\n" for line in variables) if variables else ""
    if len(times):
        result += f"TIME\ntime set: 1\nnumber of steps: {len(times)}\nfilename start number: 3\n"
        result += "filename increment: 2\ntime values:\n"
        result += "".join(f"  {time}\n" for time in times)
    return result + more
