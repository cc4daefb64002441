import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.comparison import matching
from meshreel.evaluation.recorded import COLUMNS, read_recorded

ROW = {
    "sequence": "flag", "n": "72", "k": "8", "m": "112", "codec": "famc", "params": "q=8, tr=1",
    "bytes_total": "100", "bytes_connectivity": "20", "bpvf_total": "1.39",
    "kg_error_percent": "0.5", "max_err_over_diag": "0.002", "enc_s": "1.5", "dec_s": "0.5",
    "rms_err_over_diag": "0.001",
}  # fmt: skip


@pytest.fixture
def write(tmp_path):
    def write_rows(*rows, columns=COLUMNS):
        lines = [",".join(columns)]
        lines += [",".join(f'"{row[name]}"' for name in columns) for row in rows]
        path = tmp_path / "rd.csv"
        path.write_text("\n".join(lines))
        return path

    return write_rows


def test_read_recorded_returns_errors_in_percent(write):
    (point,) = read_recorded(write(ROW))
    assert (point["codec"], point["params"]) == ("famc (recorded)", "q=8, tr=1")
    assert point["sequence"] == {"name": "flag", "n_verts": 72, "n_frames": 8}
    assert point["rate_bpvf"] == 1.39
    assert point["quality"] == pytest.approx(
        {"kg_error_percent": 0.5, "max_error_percent": 0.2, "rms_error_percent": 0.1}
    )
    assert point["seconds"] == {"encode": 1.5, "decode": 0.5}


def test_matching_omits_rows_of_another_name_or_shape(write):
    rows = [ROW, ROW | {"sequence": "cow"}, ROW | {"n": "71"}, ROW | {"k": "9"}]
    points = read_recorded(write(*rows))
    result = matching(points, {"name": "flag", "n_verts": 72, "n_frames": 8})
    assert result == points[:1]


def test_error_names_missing_columns(write):
    path = write(ROW, columns=[name for name in COLUMNS if name not in ("k", "enc_s")])
    with pytest.raises(InvalidInputError, match="lacks the column k, enc_s; required: sequence"):
        read_recorded(path)


@pytest.mark.parametrize(
    ("column", "text"),
    [("bpvf_total", "much"), ("n", "7.5"), ("enc_s", ""), ("kg_error_percent", "nan"),
     ("dec_s", "-1"), ("max_err_over_diag", "inf")],
)  # fmt: skip
def test_error_names_line_and_column_of_an_invalid_number(write, column, text):
    with pytest.raises(InvalidInputError, match=f"line 3: column {column} must be .*{text!r}"):
        read_recorded(write(ROW, ROW | {column: text}))


def test_error_names_line_and_column_of_a_short_row(tmp_path):
    path = tmp_path / "rd.csv"
    path.write_text(",".join(COLUMNS) + "\nflag,72,8\n")
    with pytest.raises(InvalidInputError, match="line 2: column codec is empty"):
        read_recorded(path)


def test_file_that_is_not_text_is_rejected(tmp_path):
    path = tmp_path / "rd.csv"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InvalidInputError, match="is not a CSV file in UTF-8"):
        read_recorded(path)
