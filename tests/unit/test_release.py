"""Versions, addresses and descriptions of all packages agree."""

import importlib
import json
import re
import runpy
import tomllib

import pytest

import meshreel
from samples.pages import PAGES, ROOT, name_of

release = importlib.import_module("version")
NPM_README = ROOT / "npm" / "README.md"
STATUS = {"0": "4 - Beta"}
"""Development status of a major version; later ones are stable."""


def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_all_packages_have_one_version():
    assert release.version() == meshreel.__version__
    assert release.differences(release.COPIES, release.version()) == []


def test_all_packages_name_one_repository():
    assert release.differences(release.ADDRESSES, release.repository()) == []
    urls = [*project()["urls"].values()]
    package = json.loads((ROOT / "npm" / "package.json").read_text(encoding="utf-8"))
    urls += [package["homepage"], package["bugs"]]
    assert [url for url in urls if not url.startswith(release.repository())] == []


def test_differing_copies_are_listed(tmp_path, monkeypatch):
    for path in release.COPIES:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes((ROOT / path).read_bytes())
    monkeypatch.setattr(release, "ROOT", tmp_path)
    release.set_version("7.8.9")
    assert release.version() == "7.8.9"
    assert release.differences(release.COPIES, "7.8.9") == []
    (tmp_path / "CITATION.cff").write_text("version: 1.0.0\n")
    messages = release.differences(release.COPIES, "7.8.9")
    assert messages == ["CITATION.cff states 1.0.0, not 7.8.9"]


def test_tag_needs_the_version_and_a_dated_heading(tmp_path, monkeypatch):
    for path in (release.SOURCE, "CHANGELOG.md"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_bytes((ROOT / path).read_bytes())
    monkeypatch.setattr(release, "ROOT", tmp_path)
    version = release.version()
    (tmp_path / "CHANGELOG.md").write_text(f"# Changelog\n\n## {version} (2027-01-31)\n")
    assert release.faults_of_tag(f"v{version}") == []
    [message] = release.faults_of_tag("v99.0.0")
    assert message == f"the tag is v99.0.0, but the version is {version}"
    (tmp_path / "CHANGELOG.md").write_text(f"# Changelog\n\n## {version} (unreleased)\n")
    [message] = release.faults_of_tag(f"v{version}")
    assert "set the date" in message


def test_notes_are_the_first_section_of_the_changes(tmp_path, monkeypatch):
    text = "# Changelog\n\n## 1.1.0 (2027-03-01)\n\n- New.\n\n## 1.0.0 (2027-01-31)\n\n- Old.\n"
    (tmp_path / "CHANGELOG.md").write_text(text)
    monkeypatch.setattr(release, "ROOT", tmp_path)
    assert release.notes() == "- New."


def test_status_is_that_of_the_version():
    expected = STATUS.get(meshreel.__version__.split(".")[0], "5 - Production/Stable")
    assert f"Development Status :: {expected}" in project()["classifiers"]


@pytest.mark.parametrize("page", [*PAGES, NPM_README], ids=name_of)
def test_links_to_the_repository_lead_to_existing_files(page):
    pattern = re.escape(release.repository()) + r"/(?:blob|tree|raw)/main/([^)#\s]+)"
    for path in re.findall(pattern, page.read_text(encoding="utf-8")):
        assert (ROOT / path).exists(), path


def test_readme_of_npm_has_absolute_links_only():
    targets = re.findall(r"\]\(([^)#\s]+)", NPM_README.read_text(encoding="utf-8"))
    assert len(targets) > 5
    assert [target for target in targets if not target.startswith("https://")] == []


def test_description_on_pypi_has_absolute_links_only():
    pytest.importorskip("hatchling", reason="the extra [core] is not installed")
    hook = runpy.run_path(str(ROOT / "hatch_build.py"))["ReadmeHook"]
    metadata = {"urls": project()["urls"]}
    hook(str(ROOT), {}).update(metadata)
    text = metadata["readme"]["text"]
    tag = f"v{meshreel.__version__}"
    assert f"]({release.repository()}/blob/{tag}/docs/install.md)" in text
    assert f"]({release.repository()}/raw/{tag}/docs/images/demo.webp)" in text
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert [target for target in targets if not target.startswith(("https://", "#"))] == []
