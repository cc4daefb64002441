"""Build the add-on as a Blender extension with all required Python packages.

    python integrations/blender/build.py -o meshreel_blender.zip
    python integrations/blender/build.py -o meshreel_blender.zip --wheels dist

The first is for this machine: pip compiles meshreel from this repository. The second is for all
platforms of Blender, with meshreel's wheels in a folder, as the workflow `wheels` builds them.
Wheels of other packages come from pip's index.
"""

import argparse
import platform
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

ADD_ON = Path(__file__).parent / "meshreel_blender"
REPOSITORY = Path(__file__).parents[2]
MANIFEST = "blender_manifest.toml"

PYTHON_VERSION = "3.11"
"""Python version of Blender 4.2 to 5.0."""

PLATFORMS = {
    "linux-x64": [f"manylinux_2_{minor}_x86_64" for minor in (28, 27, 24, 17)]
    + ["manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": [f"macosx_{major}_0_arm64" for major in (12, 11)],
    "macos-x64": [f"macosx_{version}_x86_64" for version in ("11_0", "10_15", "10_14", "10_9")],
}
"""Blender's name of each platform, and its wheel tags."""

NOT_NEEDED = frozenset({"click", "numpy"})
"""Blender includes NumPy; Click is for the command line."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Build the zip and print its size."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, required=True, help="the .zip to write")
    parser.add_argument(
        "--wheels", type=Path, help="folder of meshreel's wheels; the zip is for all platforms"
    )
    options = parser.parse_args(arguments)
    platforms = list(PLATFORMS) if options.wheels else [platform_here()]
    with tempfile.TemporaryDirectory() as folder:
        wheels = collect_wheels(platforms, options.wheels, Path(folder))
        write_extension(options.output, platforms, wheels)
    size = options.output.stat().st_size
    print(f"{options.output}: {size / 1e6:.1f} MB, {len(wheels)} wheels for {', '.join(platforms)}")


def platform_here() -> str:
    """Blender's name of the platform of this machine."""
    system = {"linux": "linux", "win32": "windows", "darwin": "macos"}.get(sys.platform)
    processor = {"x86_64": "x64", "amd64": "x64"}.get(platform.machine().lower(), "arm64")
    name = f"{system}-{processor}"
    if name not in PLATFORMS:
        sys.exit(f"the extension is for {', '.join(PLATFORMS)}; this machine is {name}")
    return name


def collect_wheels(platforms: Iterable[str], own: Path | None, folder: Path) -> list[Path]:
    """Download or build the wheels for these platforms into a folder; return their paths.

    Parameters
    ----------
    platforms : iterable of str
    own : Path, optional
        Folder with a wheel of meshreel for each platform; otherwise that for this machine is built.
    folder : Path
    """
    for name in platforms:
        tags = [part for tag in PLATFORMS[name] for part in ("--platform", tag)]
        download = [
            "download", "--no-deps", "--only-binary", ":all:", "--python-version", PYTHON_VERSION,
            "--implementation", "cp", *tags, "--dest", folder,
        ]  # fmt: skip
        _pip(*download, *requirements())
        if own is None:
            _pip("wheel", "--no-deps", "--wheel-dir", folder, REPOSITORY)
        else:
            _pip(*download, "--no-index", "--find-links", own, "meshreel")
    return sorted(folder.glob("*.whl"))


def requirements() -> list[str]:
    """Requirements of meshreel that Blender does not include, in pip syntax."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
    # Markers exclude only platforms that Blender does not support.
    stated = [requirement.partition(";")[0].strip() for requirement in project["dependencies"]]
    names = {text: re.split(r"[<>=!~ \[]", text, maxsplit=1)[0] for text in stated}
    return [text for text, name in names.items() if name not in NOT_NEEDED]


def write_extension(output: Path, platforms: Iterable[str], wheels: Iterable[Path]) -> None:
    """Write the zip: the add-on, wheels, and a manifest that lists them."""
    wheels = list(wheels)
    manifest = manifest_with((ADD_ON / MANIFEST).read_text("utf-8"), platforms, wheels)
    with zipfile.ZipFile(output, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(MANIFEST, manifest)
        archive.write(REPOSITORY / "LICENSE", "LICENSE")
        for module in sorted(ADD_ON.glob("*.py")):
            archive.write(module, module.name)
        for wheel in wheels:  # already compressed
            archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)


def manifest_with(manifest: str, platforms: Iterable[str], wheels: Iterable[Path]) -> str:
    """Manifest with platforms and wheels inserted before its first table."""
    top, table, rest = manifest.partition("\n[")
    return (
        top
        + _toml_list("platforms", platforms)
        + _toml_list("wheels", (f"./wheels/{wheel.name}" for wheel in wheels))
        + table
        + rest
    )


def _toml_list(key: str, values: Iterable[str]) -> str:
    lines = "".join(f'    "{value}",\n' for value in values)
    return f"\n{key} = [\n{lines}]\n"


def _pip(*arguments: object) -> None:
    command = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*command, *map(str, arguments)], check=True)


if __name__ == "__main__":
    main()
