"""The sequences of the manifest, and their files from git."""

import re
import subprocess
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

import meshreel
from meshreel.model.sequence import MeshSequence

MANIFEST = Path(__file__).with_name("manifest.toml")

KINDS = {
    "people": "captured people",
    "animals": "animals",
    "faces": "faces",
    "cloth": "cloth",
    "soft": "soft bodies",
    "remeshed": "fluids and remeshed surfaces",
    "characters": "skinned game characters",
    "mechanical": "mechanical parts",
    "simulation": "simulation results",
    "volume": "volume meshes",
    "single": "single meshes",
    "scenes": "small test scenes",
}
"""Kinds of sequences, by their names in the manifest."""

MAX_FRAMES = 120
MAX_POSITIONS, MAX_CHANGING = 200_000, 40_000
"""Frames are left out at the end until a sequence has at most this many frames and vertices of all
frames; the latter if faces change. At least two frames are kept."""


class UnavailableError(Exception):
    """Files of a sequence that cannot be fetched."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """A sequence of the manifest.

    Attributes
    ----------
    name : str
        Unique name; default: the end of the path, or the folder of frames, and the animation.
    repo, commit : str
        Owner and name on GitHub, and a commit.
    licence : str
        SPDX identifier, or where the licence is stated.
    kind : str
        One of `KINDS`.
    path : str
        Path of its file, or a pattern of its frames; in the manifest below `root`, and followed by
        "#" and the animation, if one is chosen.
    needs : tuple of str
        Patterns of other files that it refers to; default of .gltf: the .bin of the same name.
    options : dict
        Further options of `meshreel.load`.
    """

    name: str
    repo: str
    commit: str
    licence: str
    kind: str
    path: str
    needs: tuple[str, ...]
    options: dict[str, Any]

    def load(self, files: "Files") -> MeshSequence:
        """Read the sequence, of separate frames the first ones."""
        paths = files.fetch(self)
        if len(paths) == 1:
            return meshreel.load(paths[0], merge=True, **self.options)
        n_verts = meshreel.load(paths[:2], **self.options)[0].vertices.shape[0]
        n_needed = max(min(MAX_POSITIONS // n_verts + 1, MAX_FRAMES), 2)
        return meshreel.load(paths[:n_needed], **self.options)


def read_manifest(path: Path = MANIFEST) -> list[Source]:
    """All sequences of the manifest."""
    repositories = tomllib.loads(path.read_text(encoding="utf-8")).items()
    return [
        _source(repo, kind, dict(shared["source"]), entry)
        for repo, shared in repositories
        for kind, entries in shared.items()
        if kind != "source"
        for entry in entries
    ]


def _source(repo: str, kind: str, options: dict[str, Any], entry: Any) -> Source:
    """A sequence from the fields of its repository and its entry, a path or a table of fields."""
    options |= {"path": entry} if isinstance(entry, str) else entry
    commit, licence, root = options.pop("commit"), options.pop("licence"), options.pop("root", "")
    file, _, animation = options.pop("path").partition("#")
    if animation:
        options["animation"] = int(animation) if animation.isdigit() else animation
    end = PurePosixPath(file)
    stem = end.parent.name if "*" in end.name else end.stem
    name = options.pop("name", f"{stem} {animation}".strip())
    needs = options.pop("needs", [str(end.with_suffix(".bin"))] * (end.suffix == ".gltf"))
    return Source(
        name=name, repo=repo, commit=commit, licence=licence, kind=kind, path=root + file,
        needs=tuple(root + pattern for pattern in needs), options=options,
    )  # fmt: skip


def first_frames(sequence: MeshSequence) -> MeshSequence:
    """The first frames, within the limits."""
    sizes = [segment.n_verts for segment in sequence.segments for _ in range(segment.n_frames)]
    limit = MAX_POSITIONS if sequence.n_segments == 1 else MAX_CHANGING
    n_kept = int(np.searchsorted(np.cumsum(sizes), limit, "right"))
    return sequence[: min(max(n_kept, 2), MAX_FRAMES, sequence.n_frames)]


@dataclass(frozen=True)
class Files:
    """Files of repositories, extracted to a folder.

    Parameters
    ----------
    folder : Path
        Receives the files, and clones of repositories.
    mirrors : Path, optional
        Contains git directories: OWNER+NAME, OWNER+NAME/repo, or .git in one of these. Other
        repositories are cloned from GitHub, without files that no sequence needs.
    """

    folder: Path
    mirrors: Path | None = None

    def fetch(self, source: Source) -> list[Path]:
        """Local copies of the file or the frames of a sequence, next to the files it needs.

        Raises
        ------
        UnavailableError
            If the repository, its commit or a file is missing.
        """
        git = self._git_directory(source)
        folders = {_fixed_folder(pattern) for pattern in (source.path, *source.needs)}
        listed = [name for folder in sorted(folders) for name in _list_files(git, source, folder)]
        target = self.folder / "files" / source.repo.replace("/", "+") / source.commit[:12]
        for pattern in source.needs:
            _extract(git, source, _matching(listed, pattern), target)
        names = _matching(listed, source.path)
        if not names:
            raise UnavailableError(f"{source.repo} has no file {source.path}")
        _extract(git, source, names, target)
        return [target / name for name in sorted(names, key=_natural)]

    def _git_directory(self, source: Source) -> Path:
        name = source.repo.replace("/", "+")
        for root in filter(None, (self.mirrors, self.folder / "clones")):
            for git in (root / name, root / name / "repo"):
                for candidate in (git / ".git", git):
                    if (candidate / "HEAD").is_file() and _has_commit(candidate, source.commit):
                        return candidate
        return self._clone(source, self.folder / "clones" / name)

    def _clone(self, source: Source, git: Path) -> Path:
        url = f"https://github.com/{source.repo}"
        subprocess.run(["git", "init", "--quiet", "--bare", str(git)], check=True)
        # Git fetches the contents of files when they are read.
        for setting, value in (("remote.origin.url", url), ("remote.origin.promisor", "true")):
            _git(git, "config", setting, value)
        _git(git, "fetch", "--quiet", "--depth=1", "--filter=blob:none", "origin", source.commit)
        return git


def _git(git: Path, *words: str) -> bytes:
    done = subprocess.run(["git", "-C", str(git), *words], capture_output=True, check=False)
    if done.returncode:
        raise UnavailableError(done.stderr.decode(errors="replace").strip() or f"git {words[0]}")
    return done.stdout


def _has_commit(git: Path, commit: str) -> bool:
    try:
        _git(git, "cat-file", "-e", f"{commit}^{{commit}}")
    except UnavailableError:
        return False
    return True


def _list_files(git: Path, source: Source, folder: str) -> list[str]:
    names = ["--", f"{folder}/"] if folder else []
    listed = _git(git, "ls-tree", "-r", "-z", "--name-only", source.commit, *names)
    return [name for name in listed.decode().split("\0") if name]


def _fixed_folder(pattern: str) -> str:
    """The folders of a pattern before its first wildcard."""
    return pattern.partition("*")[0].rpartition("/")[0]


def _matching(names: Iterable[str], pattern: str) -> list[str]:
    """Names that match a pattern, whose only wildcard is the asterisk."""
    literal = pattern.replace("[", "[[]").replace("?", "[?]")
    return [name for name in names if fnmatchcase(name, literal)]


def _extract(git: Path, source: Source, names: Iterable[str], target: Path) -> None:
    for name in names:
        path = target / name
        if not path.exists():
            data = _git(git, "cat-file", "blob", f"{source.commit}:{name}")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def _natural(name: str) -> list[tuple[str, int]]:
    """A key that sorts numbers in names by value."""
    return [(text, int(digits or 0)) for text, digits in re.findall(r"(\D*)(\d*)", name)]
