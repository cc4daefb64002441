"""The nodes of a glTF file and their motion, and meshes posed by nodes, joints and targets."""

from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.gltf.document import VISIBILITY, Document, JsonObject, Mesh
from meshreel.formats.scenes.scene_mesh import BLOCK_BYTES
from meshreel.formats.surfaces.hard_edges import HardEdges
from meshreel.formats.surfaces.polygons import PolygonMesh, polygon_mesh
from meshreel.model.notes import listed
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.threads import chunks, in_threads

Matrices = npt.NDArray[np.float64]

LINEAR, STEP, CUBICSPLINE = INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")

MIN_ARC_RAD = 1e-6
"""Angle between rotations below which linear interpolation replaces the spherical one."""

VISIBLE = "visible"
"""Path of channels that animate the visibility of a node."""

MAX_PATH = 4096
"""Maximum length of a node path: deep hierarchies with long names would fill the memory."""

PIECE_VALUES = 1 << 15
"""Approximate number of coordinates that a thread poses at once."""


class Nodes:
    """The nodes of a file.

    Attributes
    ----------
    parents : list of int
        Parent of each node; -1 for a root.
    ordered : list of int
        All nodes, parents first.
    """

    def __init__(self, document: Document) -> None:
        self.objects: tuple[JsonObject, ...] = document.lists["nodes"]
        self.parents: list[int] = [-1] * len(self.objects)
        self._children = [node.indices("children", "nodes") for node in self.objects]
        for parent, children in enumerate(self._children):
            for child in children:
                if self.parents[child] >= 0:
                    raise FormatError(
                        f"node {child} is a child of nodes {self.parents[child]} and {parent}; "
                        "a node must have one parent"
                    )
                self.parents[child] = parent
        self.ordered: list[int] = [node for node, parent in enumerate(self.parents) if parent < 0]
        for node in self.ordered:  # the list grows during iteration
            self.ordered += self._children[node]
        if len(self.ordered) < len(self.objects):
            cyclic_node = min(set(range(len(self.objects))) - set(self.ordered))
            raise FormatError(f"node {cyclic_node} is its own ancestor: nodes must form a tree")

    def ancestors(self, node: int) -> list[int]:
        """Return a node, its parent, and so on up to the root."""
        ancestors = []
        while node >= 0:
            ancestors.append(node)
            node = self.parents[node]
        return ancestors

    def with_ancestors(self, nodes: Iterable[int]) -> list[int]:
        """Return nodes and all their ancestors, parents first."""
        visited: set[int] = set()
        for start in nodes:
            node = start
            while node >= 0 and node not in visited:
                visited.add(node)
                node = self.parents[node]
        return [node for node in self.ordered if node in visited] if visited else []

    def below(self, nodes: Iterable[int]) -> set[int]:
        """Return all nodes below some nodes, without these unless they are below others."""
        parents, below = set(nodes), set[int]()
        for node in self.ordered:
            if self.parents[node] in parents or self.parents[node] in below:
                below.add(node)
        return below

    def with_below(self, nodes: set[int]) -> set[int]:
        """Return nodes and all nodes below them."""
        return nodes | self.below(nodes)

    def subtrees(self, roots: Iterable[int]) -> list[int]:
        """Return roots and all nodes below them, in depth-first order."""
        stack = list(roots)[::-1]
        subtrees = []
        while stack:
            node = stack.pop()
            subtrees.append(node)
            stack += self._children[node][::-1]
        return subtrees

    def paths(self, defaults: Mapping[int, str]) -> list[str]:
        """Return the paths of nodes: names from the root, each after a slash.

        Parameters
        ----------
        defaults : dict of int to str
            Name of each node if it has none.
        """
        path_nodes = self.with_ancestors(defaults)
        names = {node: self.objects[node].text("name", "") for node in path_nodes}
        paths = []
        for node, default in defaults.items():
            path: list[str] = []
            n_characters = 0
            for ancestor in self.ancestors(node):
                name = names[ancestor] or (default if ancestor == node else "")
                path.append(name or f"node_{ancestor}")
                n_characters += len(path[-1]) + 1
                if n_characters > MAX_PATH:
                    raise FormatError(
                        f"node {node}: its path is longer than {MAX_PATH} characters; "
                        "nodes are nested too deeply"
                    )
            paths.append("".join([f"/{name.replace('/', '_')}" for name in reversed(path)]))
        return paths

    def labels(self, nodes: Iterable[int]) -> str:
        """Return the names of some nodes for messages."""
        return listed(self.objects[node].label() for node in nodes)

    def hidden(self) -> list[int]:
        """Return the nodes that are hidden themselves without an animation."""
        extensions = [node.extension(VISIBILITY) for node in self.objects]
        return [
            node
            for node, extension in enumerate(extensions)
            if extension is not None and extension.get("visible") is False
        ]

    @cached_property
    def _rest(self) -> list[dict[str, Floats] | FormatError]:
        """Matrix or other properties of each node, or the error of one with invalid numbers."""
        properties: list[dict[str, Floats] | FormatError] = []
        for json in self.objects:
            try:
                matrix = {"matrix": json.numbers("matrix", 16)} if "matrix" in json.values else {}
                rest = json.vectors(translation=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1))
                length = float(np.linalg.norm(rest["rotation"]))
                if not 0 < length < np.inf:
                    raise json.error("rotation", "a quaternion of length 1")
                rest["rotation"] /= length
                properties.append(rest | matrix)
            except FormatError as error:
                properties.append(error)
        return properties

    def rest(self, node: int) -> dict[str, Floats]:
        """Return the translation, unit quaternion x y z w and scale of a node, and its matrix.

        The matrix is missing if the node has none.
        """
        rest = self._rest[node]
        if isinstance(rest, FormatError):
            raise rest
        return rest


@dataclass(frozen=True, eq=False)
class Curve:
    """Keyframes of a property."""

    keys_s: Floats
    """float64 array of shape (N,). Key times, ascending, at least one."""
    values: Floats
    """float64 array of shape (N, C)."""
    interpolation: str
    """One of `INTERPOLATIONS`."""
    tangents: tuple[Floats, Floats] | None = None
    """tuple of two float64 arrays of shape (N, C). In-tangents and out-tangents of a cubic spline.
    """
    is_rotation: bool = False
    """Whether values are quaternions."""

    def values_at(self, times_s: Floats) -> Floats:
        """Return the values at times of shape (T,), as (T, C), constant beyond the keys."""
        values = self._interpolate(times_s)
        return unit(values) if self.is_rotation else values

    def _interpolate(self, times_s: Floats) -> Floats:
        last = len(self.keys_s) - 1
        before = np.clip(np.searchsorted(self.keys_s, times_s, "right") - 1, 0, last)
        after = np.minimum(before + 1, last)
        first, second = self.values[before], self.values[after]
        if self.interpolation == STEP:
            return first
        span = (self.keys_s[after] - self.keys_s[before])[:, np.newaxis]
        elapsed = (times_s - self.keys_s[before])[:, np.newaxis]
        weight = np.clip(elapsed / np.where(span > 0, span, np.inf), 0, 1)
        if self.tangents is not None:
            in_tangents, out_tangents = self.tangents[0][after], self.tangents[1][before]
            return hermite(first, span * out_tangents, second, span * in_tangents, weight)
        if self.is_rotation:
            return slerp(unit(first), unit(second), weight)
        return (1 - weight) * first + weight * second


def hermite(
    first: Floats, out_tangent: Floats, second: Floats, in_tangent: Floats, s: Floats
) -> Floats:
    """Return values of a cubic spline at parameters s from 0 to 1, all of shape (T, C).

    Tangents are scaled by the interval between the keys.
    """
    return (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * out_tangent
        + (3 * s**2 - 2 * s**3) * second
        + (s**3 - s**2) * in_tangent
    )


def slerp(first: Floats, second: Floats, weight: Floats) -> Floats:
    """Return rotations interpolated spherically along the shorter arc, of shape (T, 4).

    Parameters
    ----------
    first, second : float64 arrays of shape (T, 4)
        Unit quaternions.
    weight : float64 array of shape (T, 1)
    """
    cosine = (first * second).sum(axis=1, keepdims=True)
    nearer = np.where(cosine < 0, -second, second)
    # From the chord, which is accurate for small angles, unlike the arc cosine.
    chord = np.linalg.norm(nearer - first, axis=1, keepdims=True)
    angle = 2 * np.arcsin(np.minimum(chord / 2, 1))
    is_arc = angle > MIN_ARC_RAD
    sine = np.where(is_arc, np.sin(angle), 1)
    before = np.where(is_arc, np.sin((1 - weight) * angle) / sine, 1 - weight)
    after = np.where(is_arc, np.sin(weight * angle) / sine, weight)
    interpolated: Floats = before * first + after * nearer
    return interpolated


def unit(quaternions: Floats) -> Floats:
    """Return quaternions of shape (T, 4) with length 1; identity where all components are 0."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return np.where(lengths > 0, quaternions / np.where(lengths > 0, lengths, 1), [0.0, 0, 0, 1])


Curves = dict[tuple[int, str], Curve]
"""The curve of each animated node and path."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The nodes of a file, and the curves that animate some of them."""

    nodes: Nodes
    curves: Curves
    """Empty if nothing is animated."""
    carriers: Collection[int]
    """Nodes whose transforms are needed."""

    @cached_property
    def animated(self) -> set[int]:
        """The nodes that are animated, or below an animated node."""
        return self.nodes.with_below({node for node, path in self.curves if path != "weights"})

    @cached_property
    def rest_worlds(self) -> dict[int, Matrices]:
        """World transforms of carriers that are not animated, of shape (1, 4, 4), by node.

        Nodes with invalid numbers are missing, and so are those below them.
        """
        worlds: dict[int, Matrices] = {}
        for node in self.nodes.with_ancestors(self.carriers):
            parent = self.nodes.parents[node]
            if node in self.animated or not (parent < 0 or parent in worlds):
                continue
            with suppress(FormatError), np.errstate(over="ignore", invalid="ignore"):
                local = self._local(node, np.zeros(1))
                worlds[node] = local if parent < 0 else worlds[parent] @ local
        return worlds

    def changing(self, nodes: Iterable[int]) -> list[int]:
        """Return the nodes, and those above them, without a transform in `rest_worlds`."""
        worlds = self.rest_worlds
        changing = self.nodes.with_ancestors(node for node in nodes if node not in worlds)
        return [node for node in changing if node not in worlds]

    def world(self, nodes: Sequence[int], times_s: Floats) -> Matrices:
        """Return the world transforms of some nodes, of shape (T, N, 3, 4)."""
        transforms = ChainMap[int, Matrices]({}, self.rest_worlds)
        for node in self.changing(nodes):
            local, parent = self._local(node, times_s), self.nodes.parents[node]
            transforms[node] = local if parent < 0 else transforms[parent] @ local
        worlds = np.empty((len(times_s), len(nodes), 3, 4))
        for index, node in enumerate(nodes):
            worlds[:, index] = transforms[node][:, :3]
        return worlds

    def _local(self, node: int, times_s: Floats) -> Matrices:
        """Return transforms of a node relative to its parent, of shape (T, 4, 4) or (1, 4, 4)."""
        rest = self.nodes.rest(node)
        if "matrix" in rest:
            return rest["matrix"].reshape(1, 4, 4).transpose(0, 2, 1)
        values = []
        for path in ("translation", "rotation", "scale"):
            curve = self.curves.get((node, path))
            values.append(rest[path][np.newaxis] if curve is None else curve.values_at(times_s))
        return compose(*values)


def compose(translations: Floats, rotations: Floats, scales: Floats) -> Matrices:
    """Return transforms that scale, then rotate, then translate, of shape (T, 4, 4).

    Parameters
    ----------
    translations, scales : float64 arrays of shape (T, 3)
    rotations : float64 array of shape (T, 4)
        Unit quaternions x y z w. Each of the three may have a single row, for all times.
    """
    x, y, z, w = rotations.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    n_times = max(len(translations), len(rotations), len(scales))
    transforms = np.zeros((n_times, 4, 4))
    transforms[:, :3, :3] = np.moveaxis(np.array(rows), 2, 0) * scales[:, np.newaxis]
    transforms[:, :3, 3] = translations
    transforms[:, 3, 3] = 1
    return transforms


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
        if (step := max(1, PIECE_VALUES // rest.size)) >= len(posed):
            pose(slice(0, len(posed)))
        else:
            in_threads(pose, chunks(len(posed), step))
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

    def positions(self, start: int, stop: int) -> Vertices:
        """Return the float32 positions of frames start..stop - 1, of shape (K, V, 3)."""
        geometry, carriers, blocks = self._geometry, self.mesh.carriers, []
        default, n_nodes = self._default_weights, len(carriers + self.motion.changing(carriers))
        curve = self.motion.curves.get((self.mesh.node, "weights"))
        step = max(1, BLOCK_BYTES // (8 * (16 * n_nodes + len(default))))
        for first in range(start, stop, step):
            times = self.times_s[first : min(first + step, stop)]
            weights = np.tile(default, (len(times), 1)) if curve is None else curve.values_at(times)
            with np.errstate(over="ignore", invalid="ignore"):  # positions are validated later
                transforms = self.motion.world(carriers, times)
                if self.mesh.skin is not None:
                    transforms = transforms @ self.mesh.skin.inverse_binds
                blocks.append(geometry.posed(weights, transforms))
        return blocks[0] if len(blocks) == 1 else np.concatenate(blocks)

    def frame(self, index: int) -> PolygonMesh:
        """Return the mesh in a frame."""
        faces = self._faces
        return PolygonMesh(self.positions(index, index + 1)[0], faces.counts, faces.corners)

    def surface(self, index: int) -> Surface:
        """Return the surface of the mesh, which is the same in all frames."""
        return self._geometry.surface

    @cached_property
    def _geometry(self) -> Geometry:
        geometry, skin = self.read(self.mesh.mesh), self.mesh.skin
        if skin is None:
            transforms = self.motion.world(self.mesh.carriers, self.times_s[:1])
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
            return polygon_mesh(geometry.positions, counts, corners)  # raises an error
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
