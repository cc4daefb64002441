"""The manifest of the built extension, and its installation in Blender."""

import importlib.util
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import meshreel
from integration.blender_session import ADD_ON_FOLDER, run_python, why_not


@pytest.fixture(scope="module")
def build():
    spec = importlib.util.spec_from_file_location("blender_build", ADD_ON_FOLDER / "build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def manifest_of(build):
    return (build.ADD_ON / build.MANIFEST).read_text("utf-8")


def test_manifest_has_the_version_of_the_library(build):
    assert tomllib.loads(manifest_of(build))["version"] == meshreel.__version__


def test_listing_wheels_preserves_the_manifest(build):
    before = tomllib.loads(manifest_of(build))
    wheels = [Path("somewhere/one-1.0-py3-none-any.whl"), Path("two-2.0-py3-none-any.whl")]
    after = tomllib.loads(build.manifest_with(manifest_of(build), ["linux-x64"], wheels))
    assert after.pop("platforms") == ["linux-x64"]
    assert after.pop("wheels") == [
        "./wheels/one-1.0-py3-none-any.whl",
        "./wheels/two-2.0-py3-none-any.whl",
    ]
    assert after == before


def test_requirements_are_the_librarys_without_those_in_blender(build):
    assert build.requirements() == ["threadpoolctl>=3.7"]


@pytest.mark.slow
def test_the_installed_extension_plays_and_exports(tmp_path, build):
    if why_not():
        pytest.skip(why_not())
    archive = tmp_path / "meshreel_blender.zip"
    command = [sys.executable, ADD_ON_FOLDER / "build.py", "-o", archive]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if "Could not find a version" in built.stderr:
        pytest.skip(f"wheels cannot be downloaded: {built.stderr}")
    assert built.returncode == 0, built.stderr
    with zipfile.ZipFile(archive) as extension:
        listed = tomllib.loads(extension.read("blender_manifest.toml").decode())["wheels"]
        assert {name.removeprefix("./") for name in listed} < set(extension.namelist())
    (tmp_path / "user").mkdir()
    script = Path(__file__).with_name("install_extension.py")
    printed = run_python(
        script, archive, tmp_path / "out.reel", BLENDER_USER_RESOURCES=str(tmp_path / "user")
    )
    assert "validated, installed, exported, imported, disabled" in printed
