"""The plan of a run: which inputs are to be encoded, and which are not."""

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

from meshreel.batch.discovery import BatchInput, find_inputs
from meshreel.batch.encode_input import EncodeOptions
from meshreel.batch.manifest import DONE, FAILED, PENDING, Manifest, Record, read_manifest
from meshreel.formats.supported_options import check_supported
from meshreel.runtime.outputs.checks import check_output_folder


@dataclass(frozen=True)
class Plan:
    """The inputs of a run: up to date, refused, or to be encoded.

    Attributes
    ----------
    input_dir, out_dir : Path
    options : EncodeOptions
    manifest : Manifest
        Of earlier runs.
    up_to_date : list of str
        Names of inputs whose streams are there.
    refused : dict of str to Record
        Inputs that cannot be encoded, with the reason.
    to_encode : dict of BatchInput to Record
        The others, as "pending".
    replaced : set of BatchInput
        Those of them whose outputs are there already.
    """

    input_dir: Path
    out_dir: Path
    options: EncodeOptions
    manifest: Manifest
    up_to_date: list[str]
    refused: dict[str, Record]
    to_encode: dict[BatchInput, Record]
    replaced: set[BatchInput]


def plan_batch(
    input_dir: Path, out_dir: Path, options: EncodeOptions, *, force: bool = False
) -> Plan:
    """The plan of a run: inputs that are new, changed or failed before are to be encoded.

    An input is up to date if its stream is there with the size it was written with, and neither
    the files of the input nor the options have changed since.

    Parameters
    ----------
    input_dir, out_dir : Path
        The second need not exist; nothing is written yet.
    options : EncodeOptions
    force : bool, default False
        Encode everything, and replace outputs that are not this batch's.

    Raises
    ------
    InvalidInputError
        If there is nothing to encode, the folder of outputs belongs to something else, or an
        option has no effect on any input.
    """
    check_output_folder(out_dir)
    inputs = find_inputs(input_dir, but_not=out_dir)
    check_supported(
        [one.source for one in inputs],
        skip_bad=options.skip_bad, allow_outside=options.allow_outside,
    )  # fmt: skip
    manifest = read_manifest(input_dir, out_dir, force=force)
    plan = Plan(input_dir, out_dir, options, manifest, [], {}, {}, set())
    rivals = _rivals(inputs)
    for one in inputs:
        earlier = manifest.records.get(one.name)
        record = Record(PENDING, one.output, True, one.fingerprint(), options.as_dict())
        is_there = (out_dir / one.output).exists()
        if one in rivals:
            plan.refused[one.name] = _refused(record, earlier, rivals[one])
        elif not force and _is_up_to_date(record, earlier, out_dir):
            plan.up_to_date.append(one.name)
        elif is_there and _is_one_of(out_dir / one.output, one.files):
            plan.refused[one.name] = _refused(record, earlier, _is_input(out_dir / one.output))
        elif is_there and not force and not _owns(earlier):
            plan.refused[one.name] = _refused(record, earlier, _exists(out_dir / one.output))
        else:
            plan.to_encode[one] = record
            plan.replaced.update([one] if is_there else [])
    return plan


def _refused(record: Record, earlier: Record | None, reason: str) -> Record:
    return Record(
        FAILED, record.output, _owns(earlier), record.fingerprint, record.options, error=reason
    )


def _owns(earlier: Record | None) -> bool:
    return earlier is not None and earlier.owns_output


def _is_up_to_date(record: Record, earlier: Record | None, out_dir: Path) -> bool:
    if earlier is None or earlier.state != DONE:
        return False
    output = out_dir / record.output
    unchanged = (earlier.output, earlier.fingerprint, earlier.options) == (
        record.output,
        record.fingerprint,
        record.options,
    )
    return unchanged and output.is_file() and output.stat().st_size == earlier.size_bytes


def _exists(output: Path) -> str:
    return f"{output} exists and was not made of this input; it is kept unless --force is given"


def _is_one_of(output: Path, files: tuple[Path, ...]) -> bool:
    return any(output.samefile(file) for file in files)


def _is_input(output: Path) -> str:
    return f"{output} is the input under another name, which is never replaced; remove the link"


def _rivals(inputs: list[BatchInput]) -> dict[BatchInput, str]:
    """Inputs that share an output, each with the reason to refuse it."""
    of_output = defaultdict(list)
    for one in inputs:
        of_output[one.output].append(one)
    return {
        one: f"{' and '.join(other.name for other in group)} would both become {output}; "
        "rename one of them"
        for output, group in of_output.items()
        if len(group) > 1
        for one in group
    }
