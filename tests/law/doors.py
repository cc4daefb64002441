"""The ways through the product: each takes a sequence, and asserts what it promises."""

import io
import json
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

import meshreel as mr
from law.judgment import (
    ROUNDING,
    Promise,
    assert_same_bits,
    assert_same_times,
    errors_of,
    extent_of,
    judge,
    largest_error,
    parts_of,
    polygons_of,
    position_error,
    times_of,
    values_of,
)  # fmt: skip
from samples.commands import run


def target(sequence, rng):
    """Return options of a target, and what they promise."""
    percent = rng.choice([0.5, 0.05, 0.003])
    length, both = percent / 100 * (extent_of(parts_of(sequence)) or 1), Promise(percent, percent)
    options = [
        ({}, Promise()),
        ({"quality": rng.choice([20, 60, 95])}, Promise()),
        ({"max_error": percent}, Promise(percent)),
        ({"max_error": f"{length:.17g}u"}, Promise(percent)),
        ({"max_error": percent, "n_modes": 2}, Promise(percent)),
        ({"bound": percent}, both),
        ({"bound": percent, "effort": rng.choice([1, 9])}, both),
        ({"bound": percent, "block_frames": rng.choice([1, 2, 5, 10])}, both),
        ({"lossless": True}, Promise(lossless=True)),
    ]
    for name, track in parts_of(sequence)[0].tracks.items():
        options.append(({"tracks": {name: "exact"}}, Promise(bounds={name: 0})))
        if track.dtype.kind == "f" and track.kind != "normal":
            size = percent / 100 * (extent_of([track]) or 1)
            options.append(({"tracks": {name: f"={size:.17g}"}}, Promise(bounds={name: size})))
    return rng.choice(options)


def encode(sequence, rng, folder):
    options, promise = target(sequence, rng)
    data = mr.encode(sequence, **options)
    judge(sequence, mr.decode(data), promise)
    judge_figures(sequence, data)
    judge_access(rng, data)


def judge_figures(sequence, data):
    """Assert that `info` and `compare` report what is true."""
    info, decoded, parts = mr.info(data), mr.decode(data), parts_of(sequence)
    assert sum(info.budget_bytes.values()) == sum(info.part_bytes.values()) == len(data)
    counts = sequence.n_frames, max(p.n_verts for p in parts), max(len(p.faces) for p in parts)
    assert (info.n_frames, info.n_verts, info.n_faces) == counts
    if len(parts) > 1:  # compare measures distances of surfaces
        return
    quality, error = mr.compare(sequence, decoded), position_error(sequence, decoded)
    percent = 100 * error / (extent_of(parts) or 1)
    np.testing.assert_allclose(quality.max_error_percent, percent, rtol=1e-6, atol=1e-12)
    for name, errors in quality.tracks.items():
        track, track_hat = sequence.tracks[name], decoded.tracks[name]
        error = largest_error(track.kind, track, track_hat)
        np.testing.assert_allclose(errors.largest, error, rtol=1e-6, atol=1e-12)


def judge_access(rng, data):
    """Assert that frames, slices and nodes that are read alone are those of `decode`."""
    decoded, n_frames = mr.decode(data), mr.info(data).n_frames
    first = rng.randrange(n_frames)
    cut = slice(first, rng.randint(first + 1, n_frames), rng.choice([None, 2]))
    with mr.open(data) as reel:
        assert_same_bits(reel[first].vertices, decoded[first].vertices, "frame")
        for found in (reel[cut], mr.decode(data, frames=cut)):
            assert found.timing == decoded[cut].timing
            for part, part_hat in zip(parts_of(found), parts_of(decoded[cut]), strict=True):
                for name in (None, *part.tracks):
                    one, other = (each.tracks.get(name, each) for each in (part, part_hat))
                    assert_same_bits(values_of(one), values_of(other), f"slice of {name}")
                    assert one.error_bound == other.error_bound
        opened = reel.segments if reel.starts[2:] else [reel]
        for segment, part in zip(opened, parts_of(decoded), strict=True):
            for name, track in part.tracks.items():
                values, stored = values_of(track), segment.track(name)
                nodes = rng.sample(range(values.shape[1]), min(3, values.shape[1]))
                assert_same_bits(stored[:, nodes], values[:, nodes], "nodes")
                assert_same_bits(stored[::-1], np.ascontiguousarray(values[::-1]), "reversed")
                assert stored.error_bound == track.error_bound


def limits(sequence, rng, folder):
    """Targets that a search meets: a size, and a KG error."""
    if rng.random() < 0.5:
        size = int(len(mr.encode(sequence, lossless=True)) * rng.choice([0.2, 0.5, 0.8]))
        data = mr.encode(sequence, size=size)
        assert len(data) <= size
    else:
        kg = rng.choice([1.0, 0.1, 0.01])
        data = mr.encode(sequence, kg=kg)
        if sequence.n_segments == 1:
            assert mr.compare(sequence, data).kg_error_percent <= kg * ROUNDING
    judge(sequence, mr.decode(data), Promise())


def dropped_order(sequence, rng, folder):
    """Each vertex has a counterpart in the decoded mesh, with its path and its values."""
    options, promise = target(sequence, rng)
    decoded = mr.decode(mr.encode(sequence, order="drop", **options))
    assert_same_times(sequence, decoded)
    for part, part_hat in zip(parts_of(sequence), parts_of(decoded), strict=True):
        assert (part.n_verts, len(part.faces)) == (part_hat.n_verts, len(part_hat.faces))
        bound = 0 if promise.lossless else decoded.error_bound
        compared = [("vector", np.inf if bound is None else bound, part, part_hat)]
        for name, track in part.tracks.items():
            track_hat = part_hat.tracks[name]
            if track.domain == "vertex":
                compared.append((track.kind, track_hat.error_bound, track, track_hat))
        fits = np.ones((part.n_verts, part.n_verts), bool)
        for kind, bound, one, other in compared:
            errors = errors_of(kind, values_of(one)[:, :, None], values_of(other)[:, None])
            fits &= (errors <= bound * ROUNDING).all(0)
        assert (maximum_bipartite_matching(csr_array(fits)) >= 0).all(), "vertices differ"


def live(sequence, rng, folder):
    options, promise = target(sequence, rng)
    options.setdefault("block_frames", rng.choice(["auto", 1, 2, 10]))
    file, times, last = io.BytesIO(), sequence.times, parts_of(sequence)[0]
    timing = {"fps": sequence.fps, "start_s": sequence.start_s} if times is None else {}
    with mr.Encoder(last.faces, file, surface=last.surface, **timing, **options) as encoder:
        for number in range(sequence.n_frames):
            [part] = parts_of(sequence[number : number + 1])
            is_new, time = part.surface is not last.surface, None
            if times is not None:
                time = times[number]
            mesh, last = {"faces": part.faces, "surface": part.surface} if is_new else {}, part
            encoder.push(part.vertices[0], part.tracks, time=time, **mesh)
    decoded = mr.decode(file.getvalue())
    assert {*sequence.starts} <= {*decoded.starts}  # and those of new ranges of tracks
    pieces = [sequence[start:end] for start, end in pairwise(decoded.starts)]
    sequence = mr.MeshSequence.of_segments(pieces, timing=sequence.timing)
    judge(sequence, decoded, promise)
    judge_figures(sequence, file.getvalue())
    judge_access(rng, file.getvalue())


def encoded_again(sequence, rng, folder):
    """Bounds of a decoded sequence are relative to the original, also when it is cut and joined."""
    first = mr.decode(mr.encode(sequence, bound=rng.choice([0.5, 0.05])))
    judge(sequence, mr.decode(mr.encode(first, **target(sequence, rng)[0])), Promise())
    cut = rng.randrange(sequence.n_frames)
    joined = mr.concatenate([first[:cut], first[cut:]] if cut else [first])
    assert_same_times(sequence, joined, tolerance=1e-12)
    pieces = [sequence[start:end] for start, end in pairwise(joined.starts)]
    original = mr.MeshSequence.of_segments(pieces, timing=joined.timing)
    judge(original, mr.decode(mr.encode(joined, bound=0.1)), Promise())


def program(*words):
    """Run the program, and return what it prints as JSON, and its notes; raise its refusal."""
    done = run(*words, "--json")
    if done.returncode:
        raise mr.MeshReelError(done.stderr[done.stderr.index("meshreel: ") :])
    return json.loads(done.stdout), done.stderr


def commands(sequence, rng, folder):
    """The commands encode, info, compare, decode --frames and batch."""
    (folder / "in").mkdir()
    is_archive, percent = sequence.n_segments == 1 and rng.random() < 0.5, rng.choice([0.5, 0.02])
    source, output = folder / "in" / ("in.npz" if is_archive else "in.reel"), folder / "out.reel"
    mr.save(sequence, source, **({} if is_archive else {"lossless": True}))
    printed, _ = program("encode", source, "-o", output, "--bound", percent)
    data, decoded = output.read_bytes(), mr.load(output)
    assert data == mr.encode(source, bound=percent), "the program and Python write other bytes"
    if sequence.n_segments == 1:
        printed["compared"] = program("compare", source, output)[0]["max_error_percent"]
    error = 100 * position_error(sequence, decoded) / (extent_of(parts_of(sequence)) or 1)
    for name in {"max_error_percent", "compared"} & {*printed}:
        np.testing.assert_allclose(printed[name], error, rtol=1e-6, atol=1e-12)
    program("info", output)
    first = rng.randrange(sequence.n_frames)
    end, cut = rng.randint(first + 1, sequence.n_frames), folder / "cut.vtkhdf"
    program("decode", output, "-o", cut, "--frames", f"{first}:{end}")
    for frame, frame_hat in zip(decoded[first:end], mr.load(cut), strict=True):
        assert_same_bits(frame.vertices, frame_hat.vertices, "frame")
    if is_archive:
        program("batch", source.parent, folder / "all", "--workers", 1, "--bound", percent)
        assert (folder / "all" / "in.reel").read_bytes() == data


PER_FRAME = "obj", "ply", "off", "stl", "vtu", "vtp"
EXACT = "npz", "vtkhdf", "reel", "h5"
TIMED = *EXACT[:3], "pvd", "abc", "usda", "usdc", "usdz", "glb", "gltf"
RENUMBERED = "glb", "gltf", "stl"


def formats(sequence, rng, folder):
    """What is written is read again, or the notes name what is not."""
    extension = rng.choice([*PER_FRAME, *EXACT, *TIMED, "pc2", "mdd"])
    name, is_gltf = "o_%04d" if extension in PER_FRAME else "o", "gl" in extension
    source, output = folder / "in.reel", folder / "out" / f"{name}.{extension}"
    output.parent.mkdir()
    mr.save(sequence, source, lossless=True)
    options = {"reel": ["--lossless"]}.get(extension, ["--max-error", 0.05] if is_gltf else [])
    command = "convert" if extension == "reel" else rng.choice(["convert", "decode"])
    printed, notes = program(command, source, "-o", output, *options)
    notes += json.dumps(printed.get("notes", []))
    topology = {"topology": output.with_suffix(".obj")} if extension in ("pc2", "mdd") else {}
    found = mr.load(output.parent if extension in PER_FRAME else output, **topology)
    if is_gltf and (sequence.times is not None or found.n_frames == 1):
        return  # glTF has keys, which become frames of one rate
    assert found.n_frames == sequence.n_frames, f"{found.n_frames} frames of .{extension}: {notes}"
    if extension in TIMED and (times_of(sequence) is not None or "rate" not in notes):
        assert_same_times(sequence, found, tolerance=0 if extension in EXACT else 1e-6)
    limit = 5e-4 * extent_of(parts_of(sequence)) if is_gltf else 0
    for number in range(sequence.n_frames):
        [part], [part_hat] = (parts_of(one[number : number + 1]) for one in (sequence, found))
        notes_of = f".{extension}: {notes}"
        judge_frame(part, part_hat, notes_of, limit, keeps=extension not in RENUMBERED)


def names_in(part):
    """Return the names of tracks and groups, and the kinds of attributes."""
    kinds, groups = (part.surface.attributes, part.surface.groups)
    return {*part.tracks, *(str(one.kind) for one in kinds), *(one.name for one in groups)}


def judge_frame(part, part_hat, notes, limit, *, keeps):
    """Assert that a frame that was read is the written one, or that notes say why not."""
    if keeps and part.n_verts == part_hat.n_verts:
        assert polygons_of(part) == polygons_of(part_hat) or "face" in notes, f"polygons in {notes}"
        pair = [part.vertices, part_hat.vertices]
    else:
        assert len(part.faces) == len(part_hat.faces) or "face" in notes, f"faces in {notes}"
        pair = [one.vertices[:, one.faces] for one in (part, part_hat)]
    if len(pair[0][0]) == len(pair[1][0]) and (keeps or part.surface.face_sizes is None):
        is_exact = any(name in notes[:9] for name in (*EXACT, "ply", "vtp", "vtu", "pvd"))
        is_text = notes.startswith((".obj", ".off"))  # read as float32 if that is close enough
        limit += 1e-6 * extent_of([part]) * (is_text and part.dtype == "f8")
        rounding = 0 if is_exact else 2e-7 * np.abs(part.vertices).max()
        error = errors_of("vector", *pair).max()
        assert error <= (limit + rounding) * ROUNDING, f"positions differ by {error} in {notes}"
        is_said = part.dtype == "f4" or "float32" in notes
        assert error <= limit * ROUNDING or is_said, f"rounded doubles are not noted: {notes}"
    for name in names_in(part) - names_in(part_hat):
        kind = part.tracks[name].kind if name in part.tracks else ""
        is_named = name in notes or "tracks" in notes
        assert is_named or kind in names_in(part_hat), f"{name} is missing in {notes}"
    for name in {*part.tracks} & {*part_hat.tracks} if keeps else ():
        track, found = part.tracks[name], part_hat.tracks[name]
        if track.shape == found.shape:
            scale = 255 if track.dtype == "u1" and found.dtype.kind == "f" else 1
            values, values_hat = values_of(track), values_of(found) * scale
            np.testing.assert_allclose(values_hat * 1.0, values * 1.0, rtol=1e-6, err_msg=notes)
        else:
            assert name in notes, f"track {name} of {found.shape} in {notes}"


DOORS = encode, limits, dropped_order, live, encoded_again, commands, formats
