"""MP4 files with a `.reel`, as docs/format.md describes them, without a codec."""

from uuid import UUID

REEL = UUID("852cfece-71bb-4975-bbc0-69f5c19c07a3").bytes


def box(kind, *parts, size=None, wide=False):
    """A box; `size` replaces the true one, `wide` stores it in 64 bits."""
    payload = b"".join(parts)
    size = len(payload) + (16 if wide else 8) if size is None else size
    if wide:
        return (1).to_bytes(4) + kind + size.to_bytes(8) + payload
    return size.to_bytes(4) + kind + payload


def media(handler, codec, sizes, *, seconds):
    """A box trak whose samples have these sizes."""
    description = box(codec, bytes(70))
    table = box(
        b"stbl",
        box(b"stsd", bytes(4), (1).to_bytes(4), description),
        box(b"stsz", bytes(8), len(sizes).to_bytes(4), *(size.to_bytes(4) for size in sizes)),
    )
    time = bytes(12) + (1000).to_bytes(4) + round(1000 * seconds).to_bytes(4) + bytes(4)
    name = bytes(8) + handler + bytes(13)
    return box(b"trak", box(b"mdia", box(b"mdhd", time), box(b"hdlr", name), box(b"minf", table)))


def mp4(*boxes, n_media=5000):
    """The boxes after those of 3 pictures in 0.12 s, and of their sound."""
    movie = media(b"vide", b"avc1", [900, 100, 200], seconds=0.12)
    movie += media(b"soun", b"mp4a", [300], seconds=0.1)
    file_type = box(b"ftyp", b"isom", bytes(4))
    return b"".join((file_type, box(b"moov", movie), box(b"mdat", bytes(n_media)), *boxes))
