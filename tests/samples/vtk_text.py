"""Files of ParaView and XDMF as text, for tests that need no library."""

import numpy as np


def write_pvd(folder, rows, name="a.pvd"):
    """Write a collection of rows such as 'timestep="1" file="f_1.vtp"'; return its path."""
    listed = "".join(f"<DataSet {row}/>" for row in rows)
    text = f'<VTKFile type="Collection"><Collection>{listed}</Collection></VTKFile>'
    (folder / name).write_text(f'<?xml version="1.0"?>{text}')
    return folder / name


def xdmf_item(text, **facts):
    """Return a DataItem of XDMF with these attributes."""
    attributes = " ".join(f"{key}={str(value)!r}" for key, value in facts.items())
    return f"<DataItem {attributes}>{text}</DataItem>"


def inline_item(values, **facts):
    """Return a DataItem of XDMF that contains an array."""
    array = np.asarray(values)
    facts = {
        "Dimensions": " ".join(map(str, array.shape)),
        "NumberType": {"f": "Float", "i": "Int", "u": "UInt"}[array.dtype.kind],
        "Precision": array.dtype.itemsize,
        "Format": "XML",
    } | facts
    return xdmf_item(" ".join(map(repr, array.ravel().tolist())), **facts)
