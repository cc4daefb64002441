"""The scene of a glTF file: the meshes at its nodes, posed by nodes, joints and morph targets."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.animation import Matrices, Motion, Nodes
from meshreel.formats.gltf.document import Document, JsonObject, Mesh
from meshreel.formats.scenes.scene_mesh import BLOCK_BYTES
from meshreel.formats.surfaces.hard_edges import HardEdges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.threads import chunks, in_threads

PIECE_FRAMES = 8
"""Frames that a thread poses at once."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints to which a mesh is bound."""

    joints: list[int]
    """Nodes of the joints."""
    inverse_binds: Matrices
    """float64 array of shape (J, 4, 4). Transforms from the bind pose to each joint."""


@dataclass(frozen=True, eq=False)
class ShownMesh:
    """A mesh at a node."""

    node: int
    mesh: Mesh
    skin: Skin | None
    """Joints that move the mesh instead of the node."""
    carriers: list[int]
    """The nodes that move the mesh."""


@dataclass(frozen=True, eq=False)
class Influences:
    """The joints that move each vertex, and their weights."""

    joints: npt.NDArray[np.int64]
    """int64 array of shape (V, K). Indices into the joints of a skin; 0 where the weight is 0."""
    weights: npt.NDArray[np.float64]
    """float64 array of shape (V, K). Nonnegative, with row sums of 1."""

    def blend(self, matrices: Matrices) -> Matrices:
        """Return the transform of each vertex, of shape (V, 3, 4), given those of the joints."""
        blended = np.zeros((len(self.joints), 3, 4))
        for joints, weights in zip(self.joints.T, self.weights.T, strict=True):
            blended += weights[:, np.newaxis, np.newaxis] * matrices[joints]
        return blended


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh at rest."""

    positions: npt.NDArray[Any]
    """float array of shape (V, 3)."""
    displacements: tuple[npt.NDArray[Any] | None, ...]
    """tuple of float arrays of shape (V, 3). Displacements by each morph target; None for a target
    without positions.
    """
    influences: Influences | None
    """Influences of joints; None for a mesh without joints."""
    faces: Faces
    """int32 array of shape (M, 3), with valid indices."""
    surface: Surface
    """Attributes, groups and hard edges, without materials."""
    materials: tuple[int, ...]
    """Indices of the materials in use."""
    n_split: int
    """Number of vertices in the file, before welding."""
    hard_edges: HardEdges | None
    """How normals were converted; None for a mesh without normals."""

    def posed(self, weights: Floats, transforms: Matrices) -> npt.NDArray[np.float32]:
        """Return the positions in several frames, of shape (T, V, 3).

        Parameters
        ----------
        weights : float64 array of shape (T, M)
            Weights of the morph targets.
        transforms : float64 array of shape (T, J, 3, 4)
            Transforms of the joints from the bind pose, or of the mesh if J is 1 without joints.
        """
        posed = np.empty((len(weights), *self.positions.shape), np.float32)
        rest = self.positions.astype(np.float64)
        fields = [
            None if field is None else np.asarray(field, np.float64) for field in self.displacements
        ]

        def pose(frames: slice) -> None:
            moved, product = np.empty_like(rest), np.empty_like(rest)
            for index in range(frames.start, frames.stop):
                moved[:] = rest
                for weight, field in zip(weights[index], fields, strict=True):
                    if field is not None and weight != 0:
                        np.multiply(field, weight, out=product)
                        moved += product
                if self.influences is None:
                    matrix = transforms[index, 0]
                    posed[index] = moved @ matrix[:, :3].T + matrix[:, 3]
                else:
                    blended = self.influences.blend(transforms[index])
                    rotated = np.einsum("vij,vj->vi", blended[:, :, :3], moved)
                    posed[index] = rotated + blended[:, :, 3]

        # By frames and not by a matrix product, whose rounding depends on the number of frames.
        if len(posed) <= PIECE_FRAMES:
            pose(slice(0, len(posed)))
        else:
            in_threads(pose, chunks(len(posed), PIECE_FRAMES))
        return posed

    def with_reversed_faces(self) -> "Geometry":
        """Return the mesh with reversed faces, for a transform that mirrors."""
        attributes = tuple(
            replace(attribute, indices=reversed_triangles(indices.reshape(-1, 3)).ravel())
            if attribute.domain is Domain.CORNER and (indices := attribute.indices) is not None
            else attribute
            for attribute in self.surface.attributes
        )
        faces = np.ascontiguousarray(reversed_triangles(self.faces))
        return replace(self, faces=faces, surface=replace(self.surface, attributes=attributes))


def reversed_triangles(triangles: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return triangles of shape (..., 3) with reversed orientation."""
    return triangles[..., [0, 2, 1]]


@dataclass(frozen=True, eq=False)
class PosedMesh:
    """A mesh at a node, animated in world space."""

    mesh: ShownMesh
    motion: Motion
    times_s: Floats
    """float64 array of shape (T,). Times at which curves are evaluated for the frames."""
    node: JsonObject
    read: Callable[[Mesh], Geometry]
    """Returns the mesh at rest."""
    _blocks: dict[int, Vertices] = dataclasses.field(default_factory=dict)

    def _positions(self, start: int, stop: int) -> Vertices:
        """Return the float32 positions of frames start..stop - 1."""
        geometry, blocks = self._geometry, []
        default = self._default_weights
        curve = self.motion.curves.get((self.mesh.node, "weights"))
        step = max(1, BLOCK_BYTES // (8 * (16 * self._n_nodes + len(default))))
        for first in range(start, stop, step):
            times = self.times_s[first : min(first + step, stop)]
            weights = np.tile(default, (len(times), 1)) if curve is None else curve.at(times)
            with np.errstate(over="ignore", invalid="ignore"):  # positions are validated later
                transforms = self._transforms(times)
                if self.mesh.skin is not None:
                    transforms = transforms @ self.mesh.skin.inverse_binds
                blocks.append(geometry.posed(weights, transforms))
        return blocks[0] if len(blocks) == 1 else np.concatenate(blocks)

    def _transforms(self, times_s: Floats) -> Matrices:
        """Return the transforms of the nodes that move the mesh, of shape (T, N, 3, 4)."""
        rest = self.motion.rest_worlds.get(self.mesh.node)
        if self.mesh.skin is not None or rest is None:
            return self.motion.world(self.mesh.carriers, times_s)
        return np.tile(rest[:, np.newaxis, :3], (len(times_s), 1, 1, 1))

    def frame(self, index: int) -> PolygonMesh:
        """Return the mesh in a frame; later frames are computed in blocks."""
        faces = self._faces
        step = max(1, BLOCK_BYTES // faces.vertices.nbytes)
        first = 0 if index == 0 else 1 + (index - 1) // step * step
        block = self._blocks.get(first)
        if block is None:  # several threads may read frames
            stop = min(first + step, len(self.times_s)) if index else 1
            block = self._positions(first, stop)
            self._blocks.clear()
            self._blocks[first] = block
        return PolygonMesh(block[index - first], faces.counts, faces.corners)

    def surface(self, index: int) -> Surface:
        """Return the surface of the mesh, which is the same in all frames."""
        return self._geometry.surface

    @cached_property
    def _geometry(self) -> Geometry:
        geometry, skin = self.read(self.mesh.mesh), self.mesh.skin
        if skin is None:
            transforms = self._transforms(self.times_s[:1])
            is_mirrored = np.linalg.det(transforms[0, 0, :, :3]) < 0
            geometry = replace(geometry, influences=None)
            return geometry.with_reversed_faces() if is_mirrored else geometry
        n_joints = len(skin.joints)
        if geometry.influences is not None and geometry.influences.joints.max() >= n_joints:
            raise FormatError(
                f"node {self.mesh.node}: its mesh refers to joint "
                f"{geometry.influences.joints.max()}, but its skin has {n_joints} joints"
            )
        return geometry

    @cached_property
    def _faces(self) -> PolygonMesh:
        geometry = self._geometry
        counts, corners = np.full(len(geometry.faces), 3, np.int64), geometry.faces.ravel()
        if not len(counts):
            return polygon_mesh(geometry.positions, counts, corners)  # refuses it
        return PolygonMesh(geometry.positions, counts, corners)

    @cached_property
    def _default_weights(self) -> Floats:
        """Weights of the morph targets unless they are animated."""
        mesh = self.mesh.mesh
        weights = np.zeros(mesh.n_targets)
        for json in (mesh.json, self.node):
            if "weights" in json.values:
                weights = json.numbers("weights", mesh.n_targets)
        return weights

    @cached_property
    def _n_nodes(self) -> int:
        """Number of nodes whose transforms are computed at once."""
        carriers, nodes = self.mesh.carriers, self.motion.nodes
        if self.mesh.skin is None and self.mesh.node in self.motion.rest_worlds:
            return 1
        return len(carriers) + len(nodes.with_ancestors(carriers))


def shown_meshes(document: Document, nodes: Nodes, notes: Notes) -> list[ShownMesh]:
    """Return the triangle meshes of the default scene, or of all nodes without a scene.

    A scene may list nodes that are not roots, although glTF forbids it: each of these is included
    once, with the transforms of all its ancestors, even those outside of the scene.

    Parameters
    ----------
    notes : Notes
        Gains a sentence if the scene lists nodes that are not roots.
    """
    scene = _default_scene(document)
    roots = nodes.ordered if scene is None else scene.indices("nodes", "nodes")
    roots = list(dict.fromkeys(roots))
    inner = [node for node in roots if nodes.parents[node] >= 0]
    if scene is not None and inner:
        notes.changed(
            f"{scene.place} lists nodes that are not roots: {nodes.labels(inner)}; each is read "
            "once, with the transforms of all its ancestors"
        )
    covered = nodes.below(roots)
    read = cache(lambda number: _read_skin(document.lists["skins"][number], document))
    meshes: list[ShownMesh] = []
    for node in nodes.subtrees(root for root in roots if root not in covered):
        json = nodes.objects[node]
        number, skin_number = json.index("mesh", "meshes"), json.index("skin", "skins")
        if number is None:
            continue
        mesh = document.mesh(document.lists["meshes"][number])
        if mesh.triangles and skin_number is not None and mesh.has_joints:
            skin = read(skin_number)
            meshes.append(ShownMesh(node, mesh, skin, skin.joints))
        elif mesh.triangles:
            meshes.append(ShownMesh(node, mesh, None, [node]))
    return meshes


def _read_skin(skin: JsonObject, document: Document) -> Skin:
    joints = skin.indices("joints", "nodes")
    if not joints:
        raise skin.error("joints", "a list of at least one node")
    if "inverseBindMatrices" not in skin:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = document.read_floats(skin, "inverseBindMatrices", "MAT4")
    if len(columns) < len(joints):
        raise FormatError(
            f"{skin.place}: has {len(columns)} inverse bind matrices for {len(joints)} joints; "
            "expected one per joint"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def _default_scene(document: Document) -> JsonObject | None:
    """Return the default scene of a file, or else the first; None without scenes."""
    scenes = document.lists["scenes"]
    return scenes[document.root.index("scene", "scenes") or 0] if scenes else None


def no_mesh_error(document: Document, nodes: Nodes) -> FormatError:
    """Return the error for a scene without triangle meshes, with the reason."""
    meshes = document.lists["meshes"]
    if not meshes:
        return FormatError("contains no mesh")
    readable = {number for number, mesh in enumerate(meshes) if document.mesh(mesh).triangles}
    if not readable:
        return FormatError("contains no triangle mesh; points and lines are not supported")
    users = [
        node for node, json in enumerate(nodes.objects) if json.index("mesh", "meshes") in readable
    ]
    scene = _default_scene(document)
    if not users or scene is None:
        noun = "triangle mesh" if len(readable) == 1 else "triangle meshes"
        return FormatError(
            f"contains {len(readable)} {noun}, but no node uses one; export it with its meshes in "
            "a scene"
        )
    return FormatError(
        f"{scene.place}, the default scene, has no triangle mesh; nodes outside of it have: "
        f"{nodes.labels(users)}; export them in the scene, or set 'scene' to another one"
    )
