"""Decoders of fields: of their integers by the core, and of their values by the plain reader."""

import numpy as np

from conformance.hierarchy import resolutions_of
from conformance.prediction import predict_fields
from meshreel.kernel.fields import coding_order
from meshreel.kernel.library import call


def decode_fields(data, n_rows, n_columns, passes=None, n_wanted=None):
    """Return integers of shape (rows, columns) that `encode_fields` wrote with the same passes.

    With `n_wanted`, return at most that many rows, the first ones.
    """
    if passes is None:
        passes = coding_order(np.empty((n_columns, 0), np.int32), np.array([0, n_columns]))
    values = np.empty((n_rows if n_wanted is None else min(n_wanted, n_rows), n_columns), np.int32)
    arguments = data, n_rows, len(values), *passes, values
    call("reel_fields_decode", *arguments, noun="fields", memory_of=passes.memory_of)
    return values


def decode_values(mesh, residuals, size, n_learned, key=None):
    """Return fields of shape (V, K), in coding order and in steps, of residuals (K, V).

    Parameters
    ----------
    mesh : FieldMesh or MeshSequence
        With faces in internal order.
    size : int
        Size of the stencil.
    key : array of shape (V, K of the key block), optional
        Values of the key block.
    """
    resolutions = resolutions_of(mesh.faces.tolist(), mesh.n_verts, size)
    order = [vertex.number for resolution in resolutions for vertex in resolution]
    known = (
        [] if key is None else [dict(zip(order, field, strict=True)) for field in key.T.tolist()]
    )
    fields = predict_fields(resolutions, residuals.tolist(), size, n_learned, known)
    return np.array([[field[v] for field in fields] for v in order])
