"""Read the headers of shared libraries (ELF, Mach-O, PE): machine, functions, dependencies."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

ELF_MACHINES = {62: "x86_64", 183: "aarch64"}
MACH_O_MACHINES = {0x01000007: "x86_64", 0x0100000C: "arm64"}
PE_MACHINES = {0x8664: "amd64", 0xAA64: "arm64"}

SHT_STRTAB, SHT_DYNAMIC, SHT_DYNSYM = 3, 6, 11
DT_NEEDED = 1
LC_SYMTAB, LC_LOAD_DYLIB = 2, 12
N_STAB, N_TYPE, N_EXT = 0xE0, 0x0E, 0x01


@dataclass(frozen=True)
class Binary:
    """A shared library.

    Attributes
    ----------
    kind : str
        "ELF", "Mach-O" or "PE".
    machine : str
    exported : set of str
        Functions that it exports.
    imported : set of str
        Functions that other libraries must provide.
    needed : set of str
        Libraries that it depends on.
    """

    kind: str
    machine: str
    exported: set[str]
    imported: set[str]
    needed: set[str]


def read_binary(data: bytes) -> Binary:
    """Read the headers of a 64-bit little-endian library.

    Raises
    ------
    ValueError
        If the format is unknown.
    """
    if data[:6] == b"\x7fELF\x02\x01":
        return _read_elf(data)
    if data[:4] == b"\xcf\xfa\xed\xfe":
        return _read_mach_o(data)
    if data[:2] == b"MZ":
        return _read_pe(data)
    raise ValueError(f"not a 64-bit ELF, Mach-O or PE library: it begins with {data[:6].hex()}")


def _text(data: bytes, offset: int) -> str:
    return data[offset : data.index(b"\0", offset)].decode()


def _read_elf(data: bytes) -> Binary:
    (table,) = struct.unpack_from("<Q", data, 40)
    size, count = struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQII", data, table + i * size) for i in range(count)]
    exported: set[str] = set()
    imported: set[str] = set()
    needed: set[str] = set()
    for _, kind, _, _, start, length, link, _ in sections:
        strings = sections[link][4] if link else 0
        for offset in range(start + 24, start + length, 24) if kind == SHT_DYNSYM else ():
            name, info, _, section, *_ = struct.unpack_from("<IBBHQQ", data, offset)
            weak = info >> 4 == 2
            if section:
                exported.add(_text(data, strings + name))
            elif not weak:
                imported.add(_text(data, strings + name))
        for offset in range(start, start + length, 16) if kind == SHT_DYNAMIC else ():
            tag, value = struct.unpack_from("<QQ", data, offset)
            if tag == DT_NEEDED:
                needed.add(_text(data, strings + value))
    machine = ELF_MACHINES.get(struct.unpack_from("<H", data, 18)[0], "unknown")
    return Binary("ELF", machine, exported, imported, needed)


def _read_mach_o(data: bytes) -> Binary:
    machine, _, _, count = struct.unpack_from("<IIII", data, 4)
    exported: set[str] = set()
    imported: set[str] = set()
    needed: set[str] = set()
    offset = 32
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, offset)
        if command == LC_LOAD_DYLIB:
            needed.add(_text(data, offset + struct.unpack_from("<I", data, offset + 8)[0]))
        elif command == LC_SYMTAB:
            symbols, n_symbols, strings, _ = struct.unpack_from("<IIII", data, offset + 8)
            for i in range(n_symbols):
                name, kind = struct.unpack_from("<IB", data, symbols + 16 * i)
                if kind & N_EXT and not kind & N_STAB:
                    found = exported if kind & N_TYPE else imported
                    found.add(_text(data, strings + name).removeprefix("_"))
        offset += size
    return Binary("Mach-O", MACH_O_MACHINES.get(machine, "unknown"), exported, imported, needed)


def _read_pe(data: bytes) -> Binary:
    (head,) = struct.unpack_from("<I", data, 60)
    machine, n_sections = struct.unpack_from("<HH", data, head + 4)
    (optional,) = struct.unpack_from("<H", data, head + 20)
    exports, _, imports, _ = struct.unpack_from("<IIII", data, head + 24 + 112)
    first = head + 24 + optional
    sections = [struct.unpack_from("<8xIIII", data, first + 40 * i) for i in range(n_sections)]

    def at(address: int) -> int:
        for size, start, raw_size, raw in sections:
            if start <= address < start + max(size, raw_size):
                return int(raw + address - start)
        raise ValueError(f"no section contains the address {address:#x}")

    exported, needed = set(), set()
    if exports:
        n_names, _, names = struct.unpack_from("<III", data, at(exports) + 24)
        for i in range(n_names):
            exported.add(_text(data, at(struct.unpack_from("<I", data, at(names) + 4 * i)[0])))
    for offset in _imports(data, at(imports)) if imports else ():
        needed.add(_text(data, at(offset)).lower())
    return Binary("PE", PE_MACHINES.get(machine, "unknown"), exported, set(), needed)


def _imports(data: bytes, offset: int) -> Iterator[int]:
    """Yield the addresses of the names of imported libraries."""
    while name := struct.unpack_from("<I", data, offset + 12)[0]:
        yield name
        offset += 20
