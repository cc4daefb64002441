"""The public interface is that of the stored list, and keeps what was released."""

import importlib
import runpy
from pathlib import Path

import pytest

import meshreel

pytest.importorskip("scipy", reason="the extra [paper] is not installed")
interface = importlib.import_module("interface")


def test_stored_interface_is_that_of_the_code():
    stored = interface.STORED.read_text(encoding="utf-8").splitlines()
    current = interface.described()
    assert sorted(set(current) ^ set(stored)) == [], "run: python release/interface.py --write"
    assert len(current) > 900


def test_declarations_of_csharp_are_those_of_the_c_header():
    script = runpy.run_path(str(Path(__file__).parents[2] / "integrations/csharp/native.py"))
    assert script["OUTPUT"].read_text(encoding="utf-8") == script["generated"]()


def test_nothing_released_disappears_within_a_major_version():
    version, lines = interface.read_released()
    if version.split(".")[0] == meshreel.__version__.split(".")[0] != "0":
        assert interface.broken(lines, interface.described()) == []


def test_removed_and_renamed_parameters_break_the_interface():
    released = ["python decode", "python decode(data)", "python decode(frames=)"]
    assert interface.broken(released, [*released, "python decode(memory=)"]) == []
    renamed = ["python decode", "python decode(data)", "python decode(range=)"]
    assert interface.broken(released, renamed) == ["python decode(frames=)"]
    assert interface.broken(released, released[:1]) == released[1:]


@pytest.mark.slow
def test_interface_lists_names_of_every_kind():
    lines = interface.described()
    for line in (
        "format 3",
        "command encode --max-error",
        "npm meshreel ReelFile",
        "npm meshreel/three ReelMesh",
        "python CorruptStreamError(MeshReelError)",
        "python Domain.VERTEX = 'vertex'",
        "python ReelFile.frames(out=)",
        "python ReelFile.order",
        "python decode(frames=)",
        "python encode(max_error=)",
        "python paper.read",
        "python torch.ReelDataset(window=)",
    ):
        assert line in lines, line
    assert not [line for line in lines if "._" in line and ".__" not in line]


def test_exports_follow_other_modules(tmp_path):
    (tmp_path / "index.ts").write_text(
        'export * from "./errors.js";\nexport { type A, B as C } from "./b.js";\n'
    )
    (tmp_path / "errors.ts").write_text("export class E {}\nexport const f = 1;\nclass G {}\n")
    assert sorted(interface._exports(Path(tmp_path, "index.ts"))) == ["A", "C", "E", "f"]
