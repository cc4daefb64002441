"""A small writer of d3plot files, from the layout in the database manual of LS-DYNA."""

from dataclasses import dataclass, field

import numpy as np

END = -999999.0
BLOCK = 512
"""Files are padded to a multiple of this number of words."""


def no_rows(width):
    return np.empty((0, width), np.int64)


@dataclass
class Model:
    """Geometry, with node numbers from 0 and the part of each element as its last column."""

    nodes: np.ndarray
    solids: np.ndarray = field(default_factory=lambda: no_rows(9))
    thick_shells: np.ndarray = field(default_factory=lambda: no_rows(9))
    beams: np.ndarray = field(default_factory=lambda: no_rows(6))
    shells: np.ndarray = field(default_factory=lambda: no_rows(5))
    part_ids: tuple = ()
    titles: dict = field(default_factory=dict)
    control: dict = field(default_factory=dict)
    ten_nodes: str = ""  # "early" or "late": where the further nodes of ten-node solids are
    last_nodes: object = 0  # the ninth and tenth nodes of ten-node solids; 0 is none
    more: tuple = ()  # words after the control words
    last: tuple = ()  # words after the user's numbers
    after: tuple = ()  # words after the titles

    @property
    def n_elements(self):
        return sum(map(len, (self.solids, self.thick_shells, self.beams, self.shells)))


def words_of(values, code):
    """The bytes of integers or floats as words such as "<4"."""
    values = np.asarray(values)
    kind = "f" if values.dtype.kind == "f" else "i"
    return np.ravel(values).astype(f"{code[0]}{kind}{code[1]}").tobytes()


def root(model, code="<4"):
    """The bytes of control words, geometry and titles, without padding."""
    control = np.zeros(64, np.int64)
    given = {
        11: 1, 15: 4, 16: len(model.nodes), 17: 6,
        23: len(model.solids) * (-1 if model.ten_nodes else 1),
        28: len(model.beams), 31: len(model.shells), 36: 3, 40: len(model.thick_shells),
    }  # fmt: skip
    numbering = np.empty(0, np.int64)
    if model.part_ids:
        sizes = [len(one) for one in (model.nodes, model.solids, model.beams, model.shells)]
        sizes.append(len(model.thick_shells))
        n_parts = len(model.part_ids)
        head = [-1, 0, 0, 0, 0, *sizes, 0, 0, 0, n_parts, 0, n_parts]
        numbering = np.array([*head, *range(1, sum(sizes) + 1), *(3 * model.part_ids)])
    given[39] = len(numbering)
    for index, value in (given | model.control).items():
        control[index] = value
    ten = np.zeros((len(model.solids), 2), int) + model.last_nodes
    ten = words_of(ten, code) if model.ten_nodes else b""
    early, late = (ten if model.ten_nodes == name else b"" for name in ("early", "late"))
    result = words_of(control, code) + b"".join(words_of(one, code) for one in model.more)
    result += words_of(np.asarray(model.nodes, float), code)
    result += words_of(model.solids + 1, code) + early
    for rows in (model.thick_shells, model.beams, model.shells):
        result += words_of(rows + 1, code)
    result += words_of(numbering, code)
    result += b"".join(words_of(one, code) for one in model.last) + late
    if model.titles:
        result += words_of([END], code) + words_of([90001, len(model.titles)], code)
        for number, title in model.titles.items():
            result += words_of([number], code) + title.encode().ljust(72)
        result += b"".join(words_of(one, code) for one in model.after)
        result += words_of([END], code)
    return result


def state(time, *tables, code="<4"):
    """The bytes of a state: its time and its tables, in their order in the manual."""
    return words_of([float(time)], code) + b"".join(
        words_of(np.asarray(table, float), code) for table in tables
    )


def padded(data, code="<4"):
    """The bytes of a file: data, the end mark and padding."""
    data += words_of([END], code)
    block = BLOCK * int(code[1])
    return data + bytes(-len(data) % block)


def write_family(path, model, files, code="<4"):
    """Write a root file and members with the states of each; returns the path of the root."""
    path.write_bytes(padded(root(model, code), code))
    for number, states in enumerate(files, 1):
        path.with_name(f"{path.name}{number:02}").write_bytes(padded(b"".join(states), code))
    return path
