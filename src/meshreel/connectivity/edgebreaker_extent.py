"""The extent of the connectivity part of a Draco stream, found without decoding it.

The attributes that follow must be those that this package appends: Draco trusts them, and forged
ones allocate gigabytes. Therefore only bytes that Draco reads up to the same position are
accepted; anything that Draco would stop at earlier is refused here.
"""

from meshreel.entropy.varint import read_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError

STANDARD, VALENCE = 0, 2
"""How the symbols are coded: as plain bits, or in a context given by a vertex's valence."""

N_CONTEXTS = 6
N_SYMBOLS = 5
TAGGED_SCHEME, RAW_SCHEME = 0, 1
MAX_TAGGED = 256  # Draco tags the bits of symbols only where there are too few for a table
MAX_SYMBOL_BITS = 8  # beyond, Draco changes the precision of its tables
TABLE_BITS = 12
BIT_STATE_LIMIT = (1 << 20) - (1 << 12)  # of the coder of single bits
TAG_STATE_BASE = 4 << TABLE_BITS  # of the coder of symbols; its states are up to 256 x as large
MAX_VARINT_BYTES = 5


def connectivity_size(data: bytes, coding: int, n_faces: int) -> int:
    """Size of the connectivity of at most `n_faces` faces at the start of `data`.

    Raises
    ------
    CorruptStreamError
        If it is damaged in a way that would change where Draco stops reading.
    """
    n_symbols, position = _read_count(data, 0, n_faces)
    _, position = _read_count(data, position, n_symbols)  # split symbols
    position = _skip_split_events(data, position, n_symbols)
    if coding == STANDARD:
        position, _ = _take_block(data, position)
    position = _skip_start_faces(data, position)
    if coding == VALENCE:
        for _ in range(N_CONTEXTS):
            position = _skip_context(data, position, n_symbols)
    return position


def _skip_split_events(data: bytes, position: int, n_symbols: int) -> int:
    """Position after the split events: two numbers each, then one bit each."""
    n_events, position = _read_count(data, position, n_symbols)
    for _ in range(2 * n_events):
        _, position = _read_count(data, position, n_symbols)
    return _skip(data, position, (n_events + 7) // 8)


def _skip_start_faces(data: bytes, position: int) -> int:
    """Position after the start faces: a probability, and bits coded by ANS."""
    end, coded = _take_block(data, _skip(data, position, 1))
    _last_state(coded, 2, BIT_STATE_LIMIT)
    return end


def _skip_context(data: bytes, position: int, n_symbols: int) -> int:
    """Position after the symbols of one context: their number, the scheme, and its data."""
    n_here, position = _read_count(data, position, n_symbols)
    if n_here == 0:
        return position
    start = _skip(data, position, 2)
    scheme, n_bits = data[position:start]
    if scheme == RAW_SCHEME and 1 <= n_bits <= MAX_SYMBOL_BITS:
        _, start = _read_table(data, start)
        return _take_block(data, start)[0]
    if scheme == TAGGED_SCHEME and n_here <= MAX_TAGGED:
        probabilities, start = _read_table(data, position + 1)
        end, coded = _take_block(data, start)
        return _skip(data, end, (_sum_of_tags(coded, probabilities, n_here) + 7) // 8)
    raise CorruptStreamError(f"{n_here} symbols of scheme {scheme} with {n_bits} bits are not used")


def _read_table(data: bytes, position: int) -> tuple[list[int], int]:
    """Probabilities, of 1 to 3 bytes each (bits 11 last: a run of zeros), and their end."""
    start = _skip(data, position, 1)
    n_probabilities = data[position]
    if not 1 <= n_probabilities <= N_SYMBOLS:
        raise CorruptStreamError(f"an alphabet has {n_probabilities} symbols, not 1..{N_SYMBOLS}")
    table: list[int] = []
    while len(table) < n_probabilities:
        end = _skip(data, start, 1)
        n_more, value = data[start] & 3, data[start] >> 2
        if n_more == 3:
            table += [0] * (value + 1)
        else:
            end = _skip(data, end, n_more)
            table.append(int.from_bytes(data[start:end], "little") >> 2)
        start = end
    if len(table) != n_probabilities or sum(table) != 1 << TABLE_BITS:
        raise CorruptStreamError(f"the probabilities {table} do not sum to {1 << TABLE_BITS}")
    return table, start


def _sum_of_tags(coded: bytes, probabilities: list[int], n_tags: int) -> int:
    """Sum of `n_tags` coded tags; each is the number of raw bits of a symbol."""
    state, position = _last_state(coded, 3, 255 * TAG_STATE_BASE)
    state += TAG_STATE_BASE
    total = 0
    for _ in range(n_tags):
        while state < TAG_STATE_BASE and position > 0:
            position -= 1
            state = state << 8 | coded[position]
        quotient, rest = state >> TABLE_BITS, state & ((1 << TABLE_BITS) - 1)
        tag = 0
        while rest >= probabilities[tag]:
            rest -= probabilities[tag]
            tag += 1
        state = quotient * probabilities[tag] + rest
        total += tag
    return total


def _last_state(coded: bytes, max_more: int, limit: int) -> tuple[int, int]:
    """The initial state of the decoder, stored at the end, and the number of bytes before it."""
    n_more = coded[-1] >> 6 if coded else max_more + 1
    if n_more > max_more or n_more >= len(coded):
        raise CorruptStreamError("coded symbols have no state")
    start = len(coded) - 1 - n_more
    state = int.from_bytes(coded[start:], "little") & ((1 << (8 * n_more + 6)) - 1)
    if state >= limit:
        raise CorruptStreamError(f"the state {state} of coded symbols is too large")
    return state, start


def _take_block(data: bytes, position: int) -> tuple[int, bytes]:
    """End of a block of bytes with its size before it, and the bytes."""
    size, position = _read_count(data, position, len(data))
    end = _skip(data, position, size)
    return end, data[position:end]


def _read_count(data: bytes, position: int, limit: int) -> tuple[int, int]:
    value, end = read_varint(data, position)
    if value > limit or end - position > MAX_VARINT_BYTES:
        raise CorruptStreamError(f"byte {position} announces {value}; at most {limit} is possible")
    return value, end


def _skip(data: bytes, position: int, size: int) -> int:
    if size > len(data) - position:
        raise TruncatedStreamError(f"{size} bytes are announced; {len(data) - position} are left")
    return position + size
