"""Stages of USD as text, and the check of files by the validators of USD."""

import pytest

QUAD = "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]"
POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
RIGID = """int[] primvars:skel:jointIndices = [%d] (
elementSize = 1
interpolation = "constant"
)
float[] primvars:skel:jointWeights = [1] (
elementSize = 1
interpolation = "constant"
)
"""
"""Binding of all points to a joint."""


def mesh(more="", *, points=POINTS, faces=QUAD, name="m"):
    """Return the text of a mesh, with further lines."""
    return f'def Mesh "{name}" {{\n{points}\n{faces}\n{more}\n}}\n'


def stage(folder, body, header="", name="a.usda"):
    """Write a stage; return its path."""
    path = folder / name
    path.write_text(f"#usda 1.0\n(\n{header}\n)\n{body}")
    return path


def assert_is_valid(path):
    """Assert that all validators of USD accept a file; skip the test if they are not installed."""
    validation = pytest.importorskip("pxr.UsdValidation")
    from pxr import Usd

    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    errors = validation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    assert [(error.GetName(), error.GetMessage()) for error in errors] == []
