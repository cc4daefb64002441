"""The plan of a run: the inputs to encode, to skip and to refuse."""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

from meshreel.app.batch.discovery import BatchInput, find_inputs
from meshreel.app.batch.encode_input import EncodeOptions
from meshreel.app.batch.manifest import DONE, FAILED, PENDING, Manifest, Record, read_manifest
from meshreel.errors import Keyword, Message
from meshreel.formats.supported_options import check_supported
from meshreel.runtime.outputs.checks import check_output_folder


@dataclass(frozen=True)
class Plan:
    """The inputs of a run: up to date, refused, or to be encoded."""

    input_dir: Path | str
    out_dir: Path
    options: EncodeOptions
    manifest: Manifest
    """Records of earlier runs."""
    up_to_date: list[str]
    """Names of inputs whose streams are up to date."""
    refused: dict[str, Record]
    """Inputs that cannot be encoded, with the reason."""
    to_encode: dict[BatchInput, Record]
    """The other inputs, with pending records."""
    replaced: set[BatchInput]
    """Inputs to encode whose outputs exist."""


def plan_batch(
    input_dir: Path | str,
    out_dir: Path,
    options: EncodeOptions,
    *,
    force: bool = False,
) -> Plan:
    """Plan a run that encodes inputs that are new, have changed, or failed before.

    An input is up to date if its stream exists with the recorded size, and neither the input files
    nor the options have changed since. Nothing is written.

    Parameters
    ----------
    input_dir : Path, or str of a remote folder
    out_dir : Path
        Need not exist.
    force : bool, default False
        Encode everything, and replace outputs of other programs or inputs.

    Raises
    ------
    InvalidInputError
        If there are no inputs, the output folder belongs to another batch, or an option does not
        apply to any input.
    """
    check_output_folder(out_dir)
    inputs = find_inputs(input_dir, but_not=out_dir)
    check_supported([batch_input.source for batch_input in inputs], options.reading)
    manifest = read_manifest(input_dir, out_dir, force=force)
    plan = Plan(input_dir, out_dir, options, manifest, [], {}, {}, set())
    by_output = defaultdict[str, list[BatchInput]](list)
    for batch_input in inputs:
        by_output[batch_input.output].append(batch_input)
    for batch_input in inputs:
        earlier = manifest.records.get(batch_input.name)
        owns_output = earlier is not None and earlier.owns_output
        fingerprint, options_dict = batch_input.fingerprint(), options.as_dict()
        record = Record(PENDING, batch_input.output, True, fingerprint, options_dict)
        output, reason = out_dir / batch_input.output, ""
        if len(group := by_output[batch_input.output]) > 1:
            names = " and ".join(item.name for item in group)
            reason = f"{names} would both become {batch_input.output}; rename one of them"
        is_unchanged = (
            earlier is not None
            and earlier.state == DONE
            and (earlier.output, earlier.fingerprint, earlier.options)
            == (record.output, record.fingerprint, record.options)
            and output.is_file()
            and output.stat().st_size == earlier.size_bytes
        )
        if is_unchanged and not (reason or force):
            plan.up_to_date.append(batch_input.name)
            continue
        output_exists = output.exists()
        if not reason and output_exists:
            if any(output.samefile(file) for file in batch_input.files):
                reason = (
                    f"{output} is the input under another name, which is never replaced; remove "
                    "the link"
                )
            elif not (force or owns_output):
                reason = Message(
                    f"{output} exists and was not made from this input; use ",
                    Keyword("force", True),
                    " to replace it",
                )
        if reason:
            refused = replace(record, state=FAILED, owns_output=owns_output, error=reason)
            plan.refused[batch_input.name] = refused
        else:
            plan.to_encode[batch_input] = record
            plan.replaced.update([batch_input] if output_exists else [])
    return plan
