"""`show()` of sequences and files."""

import sys
from io import BytesIO
from queue import Queue
from threading import Thread
from types import SimpleNamespace
from urllib.request import urlopen

import pytest

from meshreel.app.notebook import show as showing
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence
from samples.meshes import waving_grid
from samples.players import PAGE

TIMEOUT_S = 20


@pytest.fixture(autouse=True)
def _page(monkeypatch):
    for module in ("meshreel.app.notebook.show", "meshreel.app.viewer.server"):
        monkeypatch.setattr(f"{module}.built_page", lambda: PAGE)


@pytest.fixture
def opened(monkeypatch):
    """Queue of the addresses that the browser opens; their servers stop after the test."""
    addresses, servers, serve = Queue(), [], showing.serve
    monkeypatch.setattr("webbrowser.open", addresses.put)
    monkeypatch.setattr(showing, "serve", lambda item: servers.append(serve(item)) or servers[-1])
    yield addresses
    for server in servers:
        server.shutdown()
        server.server_close()
        if server.data.measuring:
            server.data.measuring.close()


def test_browser_plays_a_file_outside_notebooks(opened, capsys):
    with ReelFile(BytesIO(encode(waving_grid(4)))) as reel:
        reel.show(block=False)
        address = opened.get(timeout=TIMEOUT_S)
        assert address in capsys.readouterr().out
        with urlopen(f"{address}stream.reel", timeout=TIMEOUT_S) as answer:
            assert answer.read() == encode(waving_grid(4))


def test_browser_compares_a_sequence_with_its_encoding(opened):
    waving_grid(4).show(block=False)
    address = opened.get(timeout=TIMEOUT_S)
    with urlopen(f"{address}api/original/3", timeout=TIMEOUT_S) as answer:
        assert answer.status == 200


def test_browser_plays_changing_faces(opened):
    sequence = MeshSequence.of_segments([waving_grid(4), waving_grid(3, 5, 6)])
    sequence.show(block=False)
    address = opened.get(timeout=TIMEOUT_S)
    with urlopen(f"{address}stream.reel", timeout=TIMEOUT_S) as answer:
        assert answer.read() == encode(sequence)


def test_cell_output_contains_the_player_in_a_notebook(opened, monkeypatch):
    shown = []
    display = SimpleNamespace(HTML=lambda text: text, display=shown.append)
    shell = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1), display=display)
    monkeypatch.setitem(sys.modules, "IPython", shell)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    waving_grid(4).show()
    assert opened.empty()
    assert "<iframe srcdoc=" in shown[0]


@pytest.mark.parametrize(("attribute", "is_prompt"), [("ps1", True), ("other", False)])
def test_prompt_is_detected_by_ps1(monkeypatch, attribute, is_prompt):
    monkeypatch.delattr(sys, "ps1", raising=False)
    monkeypatch.setattr(sys, attribute, ">>> ", raising=False)
    assert showing._is_prompt() is is_prompt


@pytest.mark.parametrize(("block", "n_waits"), [(True, 1), (False, 0)])
def test_show_waits_for_ctrl_c_when_it_blocks(opened, monkeypatch, capsys, block, n_waits):
    waits = []

    class Interrupted:
        def wait(self):
            waits.append(self)
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(showing, "threading", SimpleNamespace(Event=Interrupted, Thread=Thread))
        waving_grid(4).show(block=block)
    assert len(waits) == n_waits
    assert ("ctrl-C stops it" in capsys.readouterr().out) == block
