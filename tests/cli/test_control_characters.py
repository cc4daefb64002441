"""Control characters in names are escaped on the terminal."""

import io
import json
import os
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.app.cli import console
from meshreel.app.cli.console import print_columns, print_notes, print_table, shown_progress
from meshreel.app.cli.messages import escaped, print_error, print_line
from meshreel.model.materials import Image, Material
from meshreel.model.tracks import Track
from samples.commands import assert_fails, finished, run, run_json
from samples.meshes import two_sheets

HIDDEN = [
    *map(chr, range(0x20)),
    *map(chr, range(0x7F, 0xA0)),
    *"\u061c\u200e\u200f\u2028\u2029\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069",
    "\udc80",
]
HOSTILE = "\x1b[31m\x07\x00\x7f\x9b2J\u202e\u2066\u200f\u061c\u2028\u0085\r\nnote: forged\t[bold]b"
WIDE = "600"
"""Number of columns at which no table cell wraps."""

TIMEOUT_S = 20


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with files `a.npz` and `a.reel` that contain hostile names."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", WIDE)
    sheets = two_sheets()
    surface, hostile = sheets.surface, [f"{number}{HOSTILE}" for number in range(2)]
    names = zip(surface.attributes, hostile, strict=True)
    sequence = sheets.replace(
        name=f"shot{HOSTILE}",
        surface=replace(
            surface,
            attributes=tuple(replace(one, name=name) for one, name in names),
            groups=(
                replace(surface.groups[0], labels=tuple(hostile)),
                replace(surface.groups[0], name=f"set{HOSTILE}"),
            ),
            parts=tuple(replace(part, name=f"{part.name}{HOSTILE}") for part in surface.parts),
            materials=tuple(map(Material, hostile)),
            images=(Image(f"skin{HOSTILE}", f"image/{HOSTILE}", b"\x89PNG\r\n\x1a\n"),),
        ),
        tracks={
            f"heat{HOSTILE}": Track(
                np.linspace(0, 1, 6 * sheets.n_verts, dtype=np.float32).reshape(6, -1),
                unit=f"Pa{HOSTILE}",
            )
        },
    )
    meshreel.save(sequence.replace(surface=replace(sequence.surface, images=())), "a.npz")
    (tmp_path / "a.reel").write_bytes(meshreel.encode(sequence))
    return tmp_path


def assert_harmless(text):
    """Assert that the text has no control characters and no line that starts inside a name."""
    assert [one for one in HIDDEN if one in text and one != "\n"] == []
    assert not [line for line in text.split("\n") if line.startswith("note: forged")]


def assert_named(done, *names):
    """Assert that a command succeeded and printed these names in escaped form."""
    assert done.returncode == 0, done.stderr
    assert_harmless(done.stdout)
    assert_harmless(done.stderr)
    for name in names:
        assert escaped(name + HOSTILE) in done.stdout + done.stderr


@pytest.mark.parametrize("hidden", HIDDEN, ids=ascii)
def test_escaped_shows_no_hidden_character(hidden):
    shown = escaped(f"a{hidden}b")
    assert shown.isascii()
    assert shown.isprintable()
    assert (shown[0], shown[1], shown[-1]) == ("a", "\\", "b")


def test_escaped_uses_the_notation_of_python():
    assert escaped("\x1b\n\r\t\x9b\u202e\udc80") == r"\x1b\n\r\t\x9b\u202e\udc80"


@pytest.mark.parametrize("text", ["", "a b", "gr\u00fcn", "\u6b69\u304f", r"C:\new", "\U0001f600"])
def test_escaped_keeps_harmless_text(text):
    assert escaped(text) == text


@pytest.mark.parametrize("file", ["a.npz", "a.reel"])
def test_info_escapes_names(folder, file):
    done = run("info", file)
    assert_named(done, "shot", "/root/a", "/root/b", "0", "1", "heat")
    # Each item of a list is on its own line.
    lines = [line for line in done.stdout.split("\n") if "/root/" in line]
    assert len(lines) == 2
    assert all(line.startswith("  ") for line in lines)


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("info a.reel", ["image/"]),
        ("encode a.npz -o b.reel", ["heat", " Pa"]),
        ("decode a.reel -o b.npz", ["0"]),
        ("decode a.reel -o b.glb", ["heat"]),
        ("decode a.reel -o b.usda", []),
        ("decode a.reel -o b_%d.obj", ["heat"]),
        ("convert a.npz -o b.reel", ["heat"]),
        ("convert a.npz -o b_%d.stl", ["heat"]),
        ("compare a.npz a.reel", ["heat", " Pa"]),
    ],
)
def test_tables_and_notes_escape_names(folder, command, names):
    assert_named(run(*command.split()), *names)


@pytest.mark.slow
def test_batch_escapes_names_of_files_and_errors(folder):
    os.mkdir("in")
    os.rename("a.npz", f"in/a{HOSTILE.replace(chr(0), '')}.npz")
    (folder / "in" / "b\x1b[31m.npz").write_bytes(b"no archive")
    done = run("batch", "in", "out", "--workers", "1")
    assert done.returncode == 1
    assert_harmless(done.stdout)
    assert_harmless(done.stderr)
    assert r"b\x1b[31m.npz" in done.stderr


@pytest.mark.parametrize(
    "words", ["encode a.npz -o b.reel --track heat{}=1", "info bad{}.reel", "info a.npz --no{}"]
)
def test_error_escapes_names_of_tracks_damaged_files_and_options(folder, words):
    hostile = "\x1b[31m\n\u202e"
    (folder / f"bad{hostile}.reel").write_bytes(b"REEL")
    done = run(*(word.format(hostile) for word in words.split()))
    assert_fails(done, "x1b[31m", "u202e")
    assert_harmless(done.stderr)


@pytest.mark.parametrize("command", ["info", "encode", "decode", "convert", "compare", "view"])
def test_error_escapes_the_name_of_a_missing_file(folder, command):
    missing = "none\x1b[31m\x9b\u202e\r\nnote: forged.reel"
    words = {"decode": ["-o", "b.npz"], "convert": ["-o", "b.npz"], "compare": ["a.npz"]}
    done = run(command, missing, *words.get(command, []))
    assert_fails(done, "x1b[31m", "x9b", "u202e")
    assert_harmless(done.stderr)


def test_file_name_is_escaped_in_titles(folder):
    name = "a\x1b[31m\nb\u202e[bold].reel"
    os.rename("a.reel", name)
    assert escaped(name) == run("info", name).stdout.split("\n")[0]


@pytest.mark.slow
def test_program_prints_file_names_that_are_not_unicode(folder):
    name = os.fsencode(folder) + b"/\xff\x1b.reel"
    try:
        os.rename("a.reel", name)
    except OSError:
        pytest.skip("this file system requires Unicode names")
    done = finished([sys.executable, "-m", "meshreel", "info", name])
    assert done.returncode == 0, done.stderr
    assert r"/\udcff\x1b.reel" in done.stdout.split("\n")[0]


def test_json_contains_the_unescaped_names_in_ascii(folder):
    printed = run("info", "a.reel", "--json").stdout
    assert printed.isascii()
    assert_harmless(printed)
    assert "\x7f" not in printed
    figures = json.loads(printed)
    assert figures["name"] == f"shot{HOSTILE}"
    assert [part.endswith(HOSTILE) for part in figures["parts"]] == [True, True]
    notes = run_json("convert", "a.npz", "-o", "b_%d.stl")["notes"]
    assert any(f"heat{HOSTILE}" in note for note in notes)


MARKUP = "[bold]a[/bold] [red]b :smile: [link=x]c[/] \\"


@pytest.fixture
def printed(capsys, monkeypatch):
    """A function that prints a text by every printing function; it returns stdout and stderr."""
    monkeypatch.setenv("COLUMNS", WIDE)

    def print_by_all(text):
        print_table(text, {text: text, "list": [text, text]})
        print_columns(text, ("one", "two"), [(text, text)])
        print_line(text)
        print_notes([text])
        print_error(text)
        return capsys.readouterr()

    return print_by_all


N_PRINTED = 1 + 4 + 1 + 2 + 1


def test_markup_and_emoji_codes_are_not_interpreted(printed):
    out, err = printed(MARKUP)
    assert (out.count(MARKUP), err.count(MARKUP)) == (N_PRINTED, 2)


def test_every_printing_function_escapes(printed):
    hostile = f"a{HOSTILE}\udc80"
    out, err = printed(hostile)
    assert_harmless(out)
    assert_harmless(err)
    assert out.count(escaped(hostile)) == N_PRINTED
    assert len(err.splitlines()) == 2


def wait_for(text, stream):
    deadline = time.monotonic() + TIMEOUT_S
    while text not in stream.getvalue():
        assert time.monotonic() < deadline, f"no {text!r} in {TIMEOUT_S} s"
        time.sleep(0.005)


def test_progress_escapes_the_stage(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(console, "LOG_AFTER_S", 0)
    monkeypatch.setattr(console, "LOG_INTERVAL_S", 0.1)
    with shown_progress(stream) as report:
        report(f"reading {HOSTILE}\udc80", 0.5)
        wait_for(escaped(HOSTILE), stream)
    assert_harmless(stream.getvalue())
