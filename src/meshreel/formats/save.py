"""Saving of sequences and of streamed frames in any format."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.images import reencode_images
from meshreel.errors import ConnectivityChangeError, Keyword
from meshreel.formats.frames.frame_stream import FrameStream, RigFit, SegmentedStream
from meshreel.formats.frames.shared_data import share_materials
from meshreel.formats.kinds import FolderFormat, FrameFormat, SequenceFormat
from meshreel.formats.options import WriteOptions, origin_of
from meshreel.formats.outputs import DEFAULT_OPTIONS, check_output, is_pattern, numbering
from meshreel.formats.registry import FRAME_FORMATS, SEQUENCE_FORMATS, output_format_of
from meshreel.formats.sources import AnyPath
from meshreel.formats.surfaces.images import image_folder, image_names
from meshreel.model.materials import Image
from meshreel.model.notes import (
    Notes,
    note_unwritten_cells,
    note_unwritten_materials,
    note_unwritten_times,
    note_unwritten_tracks,
)
from meshreel.model.surface import SURFACE_DOMAINS, VALUE_TYPES, Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource, track_blocks
from meshreel.runtime.counting import plural
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.progress import Progress, silent

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource

ATTRIBUTE_KINDS = {TrackKind.UV: Kind.UV, TrackKind.COLOR: Kind.COLOR}
"""Kinds of tracks that become attributes of the surface where they never change."""


def save_part(
    sequence: "AnySource",
    frames: range,
    output: AnyPath,
    *,
    overwrite: bool = False,
    start_number: int | None = None,
    inputs: Iterable[Path] = (),
    options: WriteOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
    notes: Notes | None = None,
    figures: dict[str, Any] | None = None,
    fit_rig: RigFit | None = None,
) -> list[Path]:
    """Save a range of frames; return the written files. See `meshreel.save`.

    Parameters
    ----------
    frames : range
        Consecutive frame numbers; the start time is adjusted.
    start_number : int, optional
        Number of the first file of a pattern; default the number of its frame.
    inputs : iterable of Path
        Further input files, which are never replaced.
    figures : dict of str to any, optional
        Receives the sizes of a rig, which otherwise are notes.
    fit_rig : callable, optional
        As of `SegmentedStream`; required if the options request a rig.
    sequence, output, overwrite, options, progress, notes
        As in `meshreel.save`.

    Raises
    ------
    FormatError, InvalidInputError
        As `meshreel.save`.
    """
    if options.origin is None:
        options = replace(options, origin=origin_of(sequence))
    stream = SegmentedStream(sequence, frames, progress=progress, notes=notes, figures=figures)
    stream = stream.map_segments(partial(_with_supported_tracks, output))
    paths = _check_paths(
        output,
        len(frames),
        n_segments=stream.n_segments,
        overwrite=overwrite,
        start_number=numbering(output, frames, start_number),
        inputs=(*inputs, *getattr(sequence, "files", ())),
        options=options,
    )
    surfaces = (mesh.surface for mesh in stream.meshes())
    reencode = reencode_images(surfaces, options.images, options.max_image, stream.notes)
    stream = stream.map_segments(lambda mesh: replace(mesh, surface=reencode(mesh.surface)))
    stream.fit_rig = fit_rig
    if options.rig and fit_rig is not None:
        stream.rig = fit_rig(stream, options, None)
    return _save(stream, paths, output, overwrite=overwrite, options=options)


def _check_paths(
    output: AnyPath, n_frames: int, *, n_segments: int = 1, **checks: Any
) -> list[Path]:
    """Return the files to write; checks as `check_output`, and whether faces may change."""
    paths = check_output(output, n_frames, **checks)
    output_format = output_format_of(Path(output))
    if n_segments > 1 and not output_format.holds_segments:
        formats = ", ".join(name for name, row in SEQUENCE_FORMATS.items() if row.holds_segments)
        raise ConnectivityChangeError(
            f"{output}: the faces change: {n_frames} frames in {n_segments} segments, but "
            f"{output_format.extension} stores the same faces in every frame; write one output per "
            "segment (convert --split, or decode ",
            Keyword("segment"),
            f"), one file per frame, or {formats}",
        )
    return paths


def _save(
    stream: SegmentedStream,
    paths: list[Path],
    output: AnyPath,
    *,
    overwrite: bool,
    options: WriteOptions,
) -> list[Path]:
    """Write a stream to checked paths, which appear together; return them and those of images."""
    output_format = output_format_of(Path(output))
    if output_format.has_image_folder:
        stream, _ = share_materials(stream)
    images = _image_files(output_format, paths[0], stream)
    with replace_all_when_done(
        [*images, *paths],
        overwrite=overwrite,
        makes_folder=bool(images) or is_pattern(output) or len(paths) > 1,
    ) as hidden_paths:
        hidden_outputs = hidden_paths[len(images) :]
        for path, image in zip(hidden_paths, images.values(), strict=False):
            path.write_bytes(image.data)
        if isinstance(output_format, FrameFormat):
            _write_frames(output_format, stream, hidden_outputs)
            return paths
        if isinstance(output_format, FolderFormat):
            output_format.write(hidden_paths[0].parent, Path(output).stem, stream.only(), options)
        else:
            if output_format.data_files is not None:
                names = [path.relative_to(paths[0].parent).as_posix() for path in paths[1:]]
                stream.data_files = list(zip(names, hidden_outputs[1:], strict=True))
            _write_sequence(output_format, hidden_outputs, stream, options)
        stream.progress("writing", 1.0)
    return [*paths, *images]


def _with_supported_tracks(output: AnyPath, mesh: FrameStream) -> FrameStream:
    """Return a segment with the tracks that an output can store; its notes list the others.

    Texture coordinates and colors that stay the same in all frames of the segment become attributes
    of its surface instead.
    """
    output_format = output_format_of(Path(output))
    domains = output_format.track_domains
    if Domain.CELL not in domains:
        mesh = _without_cells(mesh, output_format.extension)
    elif mesh.surface.cells is not None and Domain.CORNER not in domains:
        domains = domains - {Domain.FACE}  # values are of points or cells
    supported = {name: track for name, track in mesh.tracks.items() if track.domain in domains}
    unsupported = {name: track for name, track in mesh.tracks.items() if name not in supported}
    constant = _constant_attributes(unsupported, mesh.surface)
    left_out = {name: track for name, track in unsupported.items() if name not in constant}
    for missing in (
        [domain for domain in SURFACE_DOMAINS if domain not in domains] if domains else []
    ):
        names = [name for name, track in left_out.items() if track.domain is missing]
        which = f"tracks of {plural(missing)}"
        note_unwritten_tracks(names, output_format.extension, mesh.notes, which)
    if not domains:
        note_unwritten_tracks(left_out, output_format.extension, mesh.notes)
    attributes = (*mesh.surface.attributes, *constant.values())
    return replace(mesh, tracks=supported, surface=replace(mesh.surface, attributes=attributes))


def _without_cells(mesh: FrameStream, extension: str) -> FrameStream:
    """Return a segment without cells and their values; its notes say so."""
    surface = mesh.surface
    if surface.cells is None:
        return mesh
    tracks = {name: track for name, track in mesh.tracks.items() if track.domain is Domain.CELL}
    attributes = [row.name for row in surface.attributes if row.domain is Domain.CELL]
    note_unwritten_cells(surface.cells, [*tracks, *attributes], extension, mesh.notes)
    other_attributes = tuple(row for row in surface.attributes if row.domain is not Domain.CELL)
    return replace(
        mesh,
        surface=replace(surface, cells=None, attributes=other_attributes),
        tracks={name: track for name, track in mesh.tracks.items() if name not in tracks},
    )


def _constant_attributes(
    tracks: Mapping[str, TrackSource], surface: Surface
) -> dict[str, Attribute]:
    """Return the texture coordinates and colors among tracks whose values never change."""
    attributes = {}
    names = {attribute.name for attribute in surface.attributes}
    for name, track in tracks.items():
        kind = ATTRIBUTE_KINDS.get(track.kind)
        if kind is None or name in names or track.dtype not in VALUE_TYPES:
            continue
        [values] = track.read(0, 1)
        if all((block == values).all() for _, block in track_blocks(track)):
            attributes[name] = Attribute(name, kind, track.domain, values).indexed(values)
    return attributes


def _image_files(
    output_format: FrameFormat | SequenceFormat | FolderFormat, path: Path, stream: SegmentedStream
) -> dict[Path, Image]:
    """Return images that are stored as separate files; sets the stream's image folder."""
    images = next(stream.meshes()).surface.images if output_format.has_image_folder else ()
    if not images:
        return {}
    folder = image_folder(path)
    stream.image_folder = folder.name
    return {folder / name: image for name, image in zip(image_names(images), images, strict=True)}


def _write_frames(output_format: FrameFormat, stream: SegmentedStream, paths: list[Path]) -> None:
    """Write one file per frame."""
    remaining_paths = iter(paths)
    note_unwritten_times(stream.timing, len(paths), output_format.extension, stream.notes)
    assert output_format.encoder is not None  # check_output rejects read-only formats
    for segment in stream.segments():
        note_unwritten_materials(segment.surface, output_format.extension, segment.notes)
        encode = output_format.encoder(segment)
        for index, frame in enumerate(segment.frames()):
            next(remaining_paths).write_bytes(encode(frame, segment.values(index)))


def _write_sequence(
    output_format: SequenceFormat, paths: list[Path], stream: SegmentedStream, options: WriteOptions
) -> None:
    """Write all frames to the first path, and the first frame to the companion file, if any."""

    def note_materials(mesh: FrameStream) -> FrameStream:
        note_unwritten_materials(mesh.surface, output_format.extension, stream.notes)
        return mesh

    noted_stream = stream if output_format.holds_materials else stream.map_segments(note_materials)
    if output_format.companion:
        segment = noted_stream.only()
        encoder = FRAME_FORMATS[output_format.companion].encoder
        assert encoder is not None
        paths[1].write_bytes(encoder(segment)(segment.first, segment.values(0)))
    assert output_format.write is not None  # check_output rejects read-only formats
    output_format.write(paths[0], noted_stream, options)
