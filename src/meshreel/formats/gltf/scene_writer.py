"""A sequence to a glTF scene: a node and a mesh for each part, and one animation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json
from meshreel.formats.gltf.material_writer import Materials
from meshreel.formats.gltf.mesh_writer import write_mesh
from meshreel.formats.gltf.moving_mesh import MovingMesh, Shaded, Wanted, fit_part
from meshreel.formats.gltf.node_tree import NodeTree, path_of
from meshreel.formats.gltf.normal_targets import NormalChoice
from meshreel.formats.gltf.seams import split_at_seams
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface

QUANTIZATION = "KHR_mesh_quantization"


@dataclass(frozen=True, eq=False)
class Scene:
    """The contents of a file.

    Attributes
    ----------
    document : dict
        The JSON, without the buffer.
    buffer : BufferWriter
    meshes : list of MovingMesh
        Of the parts that have faces.
    n_isolated : int
        Vertices that no face uses, which are left out.
    has_hard_edges : bool
    """

    document: Json
    buffer: BufferWriter
    meshes: list[MovingMesh]
    n_isolated: int
    has_hard_edges: bool

    @property
    def n_targets(self) -> list[int]:
        """Morph targets of each mesh that moves, ascending."""
        return sorted(len(one.morphs.targets) for one in self.meshes if one.morphs)


class _SceneWriter:
    """The scene so far."""

    def __init__(self, surface: Surface, notes: list[str]) -> None:
        self.buffer, self.tree = BufferWriter(), NodeTree()
        self.materials = Materials(surface, self.buffer, notes)
        self.meshes: list[Json] = []
        self.moving: list[MovingMesh] = []
        self.nodes: list[int] = []
        self.n_isolated = 0

    def add(self, part: PartMesh, sequence: MeshSequence, wanted: Wanted) -> None:
        """Add a part; one without faces has nothing to be seen."""
        hard_edges = part.surface.hard_edges
        if wanted.normals is NormalChoice.NONE:
            hard_edges = None  # vertices are split for normals only
        n_verts = part.verts.stop - part.verts.start
        shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)
        split = split_at_seams(part, shading.rows.of_corner)
        used = np.zeros(n_verts, bool)
        used[split.sources] = True
        self.n_isolated += int((~used).sum())
        if not len(split.sources):
            return
        number = np.cumsum(used) - 1
        faces = number[triangulate_fans(part.counts, part.corners)].astype(np.int32)
        is_used = used[shading.rows.vertices]
        of_rows = np.cumsum(is_used) - 1
        shaded = Shaded(
            number[shading.rows.vertices[is_used]],
            of_rows[shading.triangles].astype(np.int32),
            has_hard_edges=hard_edges is not None,
        )
        positions = sequence.vertices[:, part.verts]
        moving = fit_part(positions if used.all() else positions[:, used], faces, wanted, shaded)
        split = split.renumbered(number, of_rows)
        name = path_of(part.name)[-1]
        self.nodes.append(self.tree.add(part.name, len(self.meshes), moving.placement))
        self.meshes.append(write_mesh(name, split, moving, self.buffer, self.materials))
        self.moving.append(moving)

    def animation(self, name: str, times_s: Sequence[float]) -> Json | None:
        """The animation of all meshes that move; None if none does."""
        samplers: list[Json] = []
        channels: list[Json] = []
        times = np.asarray(times_s, np.float32)
        for node, moving in zip(self.nodes, self.moving, strict=True):
            if moving.morphs is None:
                continue
            if not samplers:
                shared = self.buffer.add_samples(times, are_times=True)
            values = self.buffer.add_samples(moving.morphs.weights, are_times=False)
            target = {"node": node, "path": "weights"}
            channels.append({"sampler": len(samplers), "target": target})
            samplers.append({"input": shared, "output": values, "interpolation": "LINEAR"})
        return {"name": name, "samplers": samplers, "channels": channels} if samplers else None


def make_scene(
    sequence: MeshSequence, times_s: Sequence[float], wanted: Wanted, notes: list[str]
) -> Scene:
    """The scene that plays a sequence.

    Parameters
    ----------
    sequence : MeshSequence
    times_s : sequence of float
        When frames are, not negative.
    wanted : Wanted
    notes : list of str
        Gains a sentence for each thing of a material that glTF cannot have.
    """
    writer = _SceneWriter(sequence.surface, notes)
    parts = split_parts(sequence.faces, sequence.surface, sequence.n_verts, sequence.name)
    for part in sorted(parts, key=lambda one: len(path_of(one.name))):
        writer.add(part, sequence, wanted)
    animation = writer.animation(sequence.name or "animation", times_s)
    document: Json = {
        "asset": {"version": "2.0", "generator": "meshreel"},
        "scene": 0,
        "scenes": [{"name": sequence.name or "scene", "nodes": writer.tree.roots}],
        "nodes": writer.tree.nodes,
        "meshes": writer.meshes,
        **writer.materials.document(),
        "accessors": writer.buffer.accessors,
        "bufferViews": writer.buffer.views,
    }
    writer.materials.note_unused()
    required = set(writer.materials.textures.required)
    if animation:
        document["animations"] = [animation]
        required.add(QUANTIZATION)
    has_hard_edges = sequence.surface.hard_edges is not None
    used = required | writer.materials.textures.used
    extensions = {"extensionsUsed": sorted(used), "extensionsRequired": sorted(required)}
    document |= {key: names for key, names in extensions.items() if names}
    return Scene(document, writer.buffer, writer.moving, writer.n_isolated, has_hard_edges)
