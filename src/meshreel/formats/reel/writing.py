"""Writer for `.reel` files."""

from pathlib import Path

from meshreel.codec.achieved import measure_stream
from meshreel.codec.config import DEFAULT_ORDER
from meshreel.codec.encoder import encode
from meshreel.formats.frames.segmented_stream import SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.model.segments import AnySequence, SegmentedSequence


def write_reel(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write all frames as a `.reel` file, with the defaults of `encode`; a note gives the error."""
    segments = [segment.gather() for segment in stream.segments()]
    sequence: AnySequence = segments[0]
    if len(segments) > 1:
        sequence = SegmentedSequence(segments, stream.name, stream.start_s)
    data = encode(sequence, max_error=options.max_error, lossless=options.lossless)
    path.write_bytes(data)
    if options.lossless:
        stream.notes.append("encoded losslessly")
    elif stream.wants_notes:
        achieved = measure_stream(sequence, data, order=DEFAULT_ORDER)
        stream.notes.append(
            f"encoded with a largest error of {achieved.max_error_percent:.4f} % of the diagonal "
            f"and a KG error of {achieved.kg_error_percent:.4f} %"
        )
