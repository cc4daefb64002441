"""Alembic files written by the library, for tests."""

import numpy as np
import pytest

pytest.importorskip("alembic3d")

import imath
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

QUADS = np.array([[0, 1, 2, 3], [3, 2, 4, 5]], np.int32)
POINTS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 2, 0.5], [0, 2, 0.25]], np.float32
)


def uniform(step_s, start_s):
    return AbcCoreAbstract.TimeSampling(step_s, start_s)


def cyclic(step_s, times_s):
    kind = AbcCoreAbstract.TimeSamplingType(len(times_s), step_s)
    return AbcCoreAbstract.TimeSampling(kind, _times(times_s))


def acyclic(times_s):
    kind = AbcCoreAbstract.TimeSamplingType(AbcCoreAbstract.AcyclicFlag.kAcyclic)
    return AbcCoreAbstract.TimeSampling(kind, _times(times_s))


def archive(path):
    return Abc.OArchive(str(path))


def add_transform(parent, name, samples, sampling=None):
    """Write a transform; each sample is a list of operations and whether it inherits."""
    made = AbcGeom.OXform(parent, name)
    if sampling is not None:
        made.getSchema().setTimeSampling(sampling)
    for operations, inherits in samples:
        sample = AbcGeom.XformSample()
        for kind, *values in operations:
            sample.addOp(AbcGeom.XformOp(getattr(AbcGeom.XformOperationType, kind)), *values)
        sample.setInheritsXforms(inherits)
        made.getSchema().set(sample)
    return made


def add_mesh(parent, name, frames, sampling=None, faces=QUADS, kind="PolyMesh"):
    """Write a mesh with faces in the file's winding; a list contains those of each frame."""
    made = getattr(AbcGeom, f"O{kind}")(parent, name)
    if sampling is not None:
        made.getSchema().setTimeSampling(sampling)
    for number, frame in enumerate(frames):
        own = faces[number] if isinstance(faces, list) else faces
        sample = getattr(AbcGeom, f"O{kind}SchemaSample")()
        sample.setPositions(points_array(frame))
        sample.setFaceIndices(int_array(own.ravel()))
        sample.setFaceCounts(int_array(np.full(len(own), own.shape[1])))
        made.getSchema().set(sample)
    return made


def points_array(points):
    return imath.V3fArrayFromBuffer(np.ascontiguousarray(points, np.float32))


def int_array(numbers):
    return imath.IntArrayFromBuffer(np.ascontiguousarray(numbers, np.int32))


def vector(x, y, z):
    return imath.V3d(x, y, z)


def matrix(rows):
    return imath.M44d(*np.asarray(rows, float).ravel().tolist())


def library_samples(path):
    """Return points, face sizes and corners of each frame of the first mesh, by the library."""
    node = Abc.IArchive(str(path)).getTop()
    while not AbcGeom.IPolyMesh.matches(node.getHeader()):
        node = node.getChild(0)
    schema = AbcGeom.IPolyMesh(node.getParent(), node.getName()).getSchema()
    properties = (
        schema.getPositionsProperty(),
        schema.getFaceCountsProperty(),
        schema.getFaceIndicesProperty(),
    )
    for number in range(schema.getNumSamples()):
        yield tuple(np.array(one.samples[number]) for one in properties)


def library_meshes(path):
    """Return points of the first frame and world matrix of each mesh, read by the library."""
    return dict(_library_meshes(Abc.IArchive(str(path)).getTop(), np.eye(4)))


def _library_meshes(node, world):
    for child in (node.getChild(number) for number in range(node.getNumChildren())):
        if AbcGeom.IXform.matches(child.getHeader()):
            sample = AbcGeom.IXform(node, child.getName()).getSchema().getValue()
            result = sample.getMatrix()
            own = np.array([[result[row][column] for column in range(4)] for row in range(4)])
            below = own @ world if sample.getInheritsXforms() else own
            yield from _library_meshes(child, below)
        elif AbcGeom.IPolyMesh.matches(child.getHeader()):
            schema = AbcGeom.IPolyMesh(node, child.getName()).getSchema()
            points = np.array(schema.getPositionsProperty().getValue())
            yield child.getFullName(), (points, world)


def _times(times_s):
    result = AbcCoreAbstract.TimeVector()
    for time_s in times_s:
        result.append(time_s)
    return result
