"""`meshreel batch`: encode all sequences in a folder."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_columns, print_json, print_notes, shown_progress
from meshreel.app.cli.messages import print_error, print_line
from meshreel.app.cli.options import (
    ENCODING,
    Encoding,
    RegisteringOption,
    TrackOption,
    reading,
    track_targets,
)
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.codec.option import COUNT, Option
from meshreel.errors import Message
from meshreel.formats.options import Reading
from meshreel.registration.options import WORKERS
from meshreel.runtime.counting import size_text

if TYPE_CHECKING:
    from meshreel.app.batch.manifest import Record

SEQUENCE_EXTENSIONS = (
    ".npz .abc .usd .usda .usdc .usdz .glb .gltf .pc2 .mdd .h5 .hdf5 .hdf .vtkhdf .pvd .xdmf .xmf "
    ".d3plot .case .encas .e .ex2 .exo .g .foam .cgns .cas"
)
FRAME_EXTENSIONS = ".obj .ply .off .stl .vtu .vtp .vtk .drc"
"""Inputs of `batch.discovery`, repeated so that the help need not import every format."""


@command
def batch_command(
    input_dir: Annotated[
        str,
        Argument(
            "INPUT_DIR",
            "Folder to search, with its sub-folders, for animation files "
            f"({SEQUENCE_EXTENSIONS}) and folders of frames ({FRAME_EXTENSIONS}). Or a remote "
            "folder (s3://, gs://), whose inputs the workers download.",
        ),
    ],
    out_dir: Annotated[
        str,
        Argument(
            "OUT_DIR",
            "Folder for one .reel per input, in the same sub-folders; created if missing.",
        ),
    ],
    encoding: Annotated[Encoding, ENCODING],
    reading: Annotated[
        Reading,
        reading("attributes", "fps", "merge", "skip_bad", "allow_outside"),
    ],
    registering: RegisteringOption,
    workers: Annotated[
        int | None,
        Option(
            "Number of processes on this machine; fewer need less memory. Default: one per core.",
            range=COUNT,
            group=WORKERS,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        Option(
            "Address of a Dask scheduler whose workers have INPUT_DIR at the same path or address "
            "(needs [dask]).",
            metavar="ADDRESS",
            group=WORKERS,
        ),
    ] = None,
    track: TrackOption = (),
    force: Annotated[
        bool,
        Option("Encode everything again, and replace existing outputs.", flag="--force -f"),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Compress every animated mesh under a folder, on all cores or on a Dask cluster.

    OUT_DIR/manifest.json lists the result, size and error of each input. A second run encodes only
    new, changed and failed inputs. A failed input does not stop the others, but the exit code is 1.

    Examples:

    - `meshreel batch captures/ streams/`
    - `meshreel batch captures/ streams/ --max-error 0.1 --workers 4`
    - `meshreel batch captures/ streams/ --scheduler tcp://10.0.0.5:8786`
    - `meshreel batch s3://captures streams/`
    """
    from meshreel.app.batch.encode_input import EncodeOptions
    from meshreel.app.batch.plan import plan_batch
    from meshreel.app.batch.run import run_batch
    from meshreel.codec.options import config_of
    from meshreel.model.surface_selection import listed_names
    from meshreel.runtime.stores.address import is_remote, refuse_address
    from meshreel.runtime.threads import n_cores
    from meshreel.runtime.workers.executors import executor_of

    if workers is not None and scheduler is not None:
        raise click.UsageError("--workers and --scheduler cannot be combined; give one")
    config = config_of(**encoding)
    listed_names(reading.attributes)  # raises before any work
    tracks = track_targets(track)
    options = EncodeOptions(config, reading, registering, tracks)
    refuse_address(out_dir, "the output folder")
    inputs = input_dir.rstrip("/") if is_remote(input_dir) else Path(input_dir)
    plan = plan_batch(inputs, Path(out_dir), options, force=force)
    if plan.to_encode:
        workers = min(workers or n_cores(), len(plan.to_encode))
        try:
            with (
                shown_progress() as progress,
                executor_of(workers, scheduler, progress) as (executor, n_workers),
            ):
                report = run_batch(plan, executor, n_workers, progress=progress)
        except KeyboardInterrupt:
            print_error("stopped; finished streams are kept, and another run encodes the others")
            raise
    else:
        report = run_batch(plan, None)
    records = report.encoded.items()
    print_notes(
        [Message.prefixed(f"{name}: ", note) for name, record in records for note in record.notes]
    )
    for name, record in report.failed.items():
        print_error(Message.prefixed(f"{name}: ", record.error or ""))
    if as_json:
        print_json({"manifest": str(plan.manifest.path), **report.as_dict()})
    else:
        if report.encoded:
            headings = ("encoded", "raw", "file", "ratio", "KG error %", "largest error %", "s")
            print_columns(out_dir, headings, [_row(name, record) for name, record in records])
        print_line(report.summary)
    if report.failed:
        raise click.exceptions.Exit(1)


def _row(name: str, record: "Record") -> tuple[str, ...]:
    return (
        name,
        size_text(record.raw_size_bytes or 0),
        size_text(record.size_bytes or 0),
        _text(record.ratio, ".1f", " x"),
        _text(record.kg_error_percent, ".4f"),
        _text(record.max_error_percent, ".4f"),
        _text(record.seconds, ".1f"),
    )


def _text(figure: float | None, form: str, unit: str = "") -> str:
    return "-" if figure is None else f"{figure:{form}}{unit}"
