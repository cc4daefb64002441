"""MP4 files that contain a `.reel` beside a video and sound; docs/format.md describes its box."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from struct import iter_unpack

from meshreel.errors import CorruptStreamError

REEL_UUID = bytes.fromhex("852cfece71bb4975bbc069f5c19c07a3")
MAX_BOXES = 64
MAX_TABLE_BYTES = 1 << 26
"""Size of a list of samples that is read."""

Read = Callable[[int, int], bytes]
"""Returns bytes by offset and size, fewer at the end."""


@dataclass(frozen=True)
class MediaTrack:
    """The "video" or the "sound" of an MP4 file, whose `codec` is avc1 for H.264, mp4a for AAC."""

    kind: str
    codec: str
    size_bytes: int
    duration_s: float

    @property
    def mbit_per_s(self) -> float:
        """Mean rate in Mbit/s; 0 if the duration is 0."""
        return 8e-6 * self.size_bytes / self.duration_s if self.duration_s else 0.0


def reel_box(data: bytes) -> bytes:
    """Return the box for the end of an MP4 file that contains a `.reel`."""
    size = 24 + len(data)
    wide = (size + 8).to_bytes(8) if size >= 1 << 32 else b""
    return (1 if wide else size).to_bytes(4) + b"uuid" + wide + REEL_UUID + data


def find_reel(read: Read, size_bytes: int) -> range:
    """Return the bytes of the `.reel` in a file of this size, which may be one itself.

    Raises
    ------
    CorruptStreamError
        If none of the first `MAX_BOXES` of an MP4 file contains a `.reel`, or one is damaged.
    """
    if read(4, 4) != b"ftyp":
        return range(size_bytes)
    for payload in _find(read, range(size_bytes), b"uuid"):
        if read(payload.start, 16) == REEL_UUID:
            return payload[16:]
    raise CorruptStreamError(
        "is an MP4 file without a .reel in it; `meshreel register --texture -o FILE.mp4` writes "
        "files with both"
    )


def read_media(read: Read, size_bytes: int) -> tuple[MediaTrack, ...]:
    """Return the video and the sound of an MP4 file; raises CorruptStreamError if damaged."""
    movie = next(_find(read, range(size_bytes), b"moov"), range(0))
    kinds, tracks = {b"vide": "video", b"soun": "sound"}, []
    for media in _find(read, movie, b"trak", b"mdia"):
        time, handler, samples, table = (
            read(found.start, min(len(found), MAX_TABLE_BYTES))
            for path in ("mdhd", "hdlr", "minf stbl stsd", "minf stbl stsz")
            for found in [next(_find(read, media, *path.encode().split()), range(0))]
        )
        if kind := kinds.get(handler[8:12]):
            time = time[20:32] if time[:1] == b"\1" else time[12:20]
            per_second, duration = int.from_bytes(time[:4]), int.from_bytes(time[4:])
            size = int.from_bytes(table[4:8]) * int.from_bytes(table[8:12])
            size = size or sum(one for (one,) in iter_unpack(">I", table[12 : len(table) & ~3]))
            codec = samples[12:16].decode("ascii", "replace")
            tracks.append(MediaTrack(kind, codec, size, per_second and duration / per_second))
    return tuple(tracks)


def _find(read: Read, within: range, kind: bytes, *inner: bytes) -> Iterator[range]:
    """Yield the payloads of the boxes of a type, or of `inner` types in these.

    Raises CorruptStreamError for a box of an impossible size.
    """
    start = within.start
    for _ in range(MAX_BOXES):
        n_left, n_head = within.stop - start, 8
        if n_left < n_head:
            return
        head = read(start, 16)
        size = int.from_bytes(head[:4]) or n_left
        if size == 1:
            size, n_head = int.from_bytes(head[8:]), 16
        if not n_head <= size <= n_left:
            raise CorruptStreamError(
                f"a box at byte {start} of the MP4 file exceeds it; fetch the file again"
            )
        payload = range(start + n_head, start + size)
        if head[4:8] == kind:
            yield from _find(read, payload, *inner) if inner else (payload,)
        start += size
