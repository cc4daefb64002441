import numpy as np
import pytest
from PIL import Image

from meshreel.errors import InvalidInputError
from meshreel.rendering.picture import contact_sheet, save_png

RED, BLUE = (200, 10, 10), (10, 10, 200)


def panel(color=RED, width=160, height=120):
    return np.full((height, width, 3), color, np.uint8)


def count(sheet, color):
    return int((np.asarray(sheet) == np.array(color, np.uint8)).all(axis=2).sum())


def ink_rows(sheet):
    return np.flatnonzero((np.asarray(sheet).max(axis=2) < 140).any(axis=1))


def test_contact_sheet_shows_every_pixel_of_different_panels():
    sheet = contact_sheet([[panel(), panel(BLUE, 40, 200)]], column_titles=["a", "b"])
    assert (count(sheet, RED), count(sheet, BLUE)) == (160 * 120, 40 * 200)


def test_contact_sheet_writes_titles_above_the_panels():
    sheet = contact_sheet([[panel((250, 250, 250))]], column_titles=["original"])
    assert ink_rows(sheet).max() < sheet.height - 120


def test_contact_sheet_writes_the_caption_below_the_panels():
    bare = contact_sheet([[panel((250, 250, 250))]])
    sheet = contact_sheet([[panel((250, 250, 250))]], caption="flag")
    assert sheet.height > bare.height
    assert ink_rows(sheet).min() > 120


def test_contact_sheet_wraps_wide_captions():
    short, long = (contact_sheet([[panel()]], caption="word " * n_words) for n_words in (2, 40))
    assert long.width == short.width
    assert long.height > short.height


def test_contact_sheet_has_a_white_border():
    sheet = np.asarray(contact_sheet([[panel()]], column_titles=["title"], caption="caption"))
    border = np.concatenate([sheet[0], sheet[-1], sheet[:, 0], sheet[:, -1]])
    assert (border == 255).all()


def test_contact_sheet_shows_every_panel_of_a_short_last_row():
    sheet = contact_sheet([[panel(), panel()], [panel(BLUE)]], row_titles=["a", "b"])
    assert (count(sheet, RED), count(sheet, BLUE)) == (2 * 160 * 120, 160 * 120)


def test_contact_sheet_aligns_panels_in_columns():
    sheet = np.asarray(contact_sheet([[panel()], [panel(BLUE)]], row_titles=["a", "longer"]))
    left = [
        np.flatnonzero((sheet == np.array(color)).all(axis=2).any(axis=0))[0]
        for color in (RED, BLUE)
    ]
    assert left[0] == left[1]


def test_contact_sheet_writes_row_titles_left_of_the_panels():
    sheet = np.asarray(contact_sheet([[panel((250, 250, 250))]], row_titles=["flag"]))
    first_column = np.flatnonzero((sheet == 250).all(axis=2).any(axis=0))[0]
    assert (sheet[:, :first_column] < 110).any()


@pytest.mark.parametrize(
    ("rows", "titles"),
    [
        ([], {}),
        ([[]], {}),
        ([[panel()], []], {}),
        ([[panel()]], {"column_titles": ["a", "b"]}),
        ([[panel()]], {"row_titles": ["a", "b"]}),
        ([[panel().astype(float)]], {}),
        ([[panel()[:, :, 0]]], {}),
    ],
)
def test_contact_sheet_rejects_invalid_panels_and_titles(rows, titles):
    with pytest.raises(InvalidInputError):
        contact_sheet(rows, **titles)


def test_save_png_round_trips_pixels(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 256, (9, 7, 3), np.uint8)
    save_png(pixels, tmp_path / "noise.png")
    with Image.open(tmp_path / "noise.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)


def test_save_png_does_not_overwrite_a_file_by_default(tmp_path):
    (tmp_path / "old.png").write_bytes(b"old")
    with pytest.raises(InvalidInputError, match="exists"):
        save_png(panel(), tmp_path / "old.png")
    assert (tmp_path / "old.png").read_bytes() == b"old"


def test_save_png_replaces_a_file_with_overwrite(tmp_path):
    (tmp_path / "old.png").write_bytes(b"old")
    save_png(panel(), tmp_path / "old.png", overwrite=True)
    assert (tmp_path / "old.png").read_bytes().startswith(b"\x89PNG")
