"""Projects that install the npm package from the output of `npm pack`."""

import fcntl
import json
import os
import shutil
import subprocess

import pytest

from samples.web_package import PACKAGE, built_package

EXAMPLES = PACKAGE / "examples"
COMMAND_S = 300
OUT_OF_REACH = ("ENOTFOUND", "ECONNREFUSED", "ECONNRESET", "EAI_AGAIN", "ETIMEDOUT", "ENOTCACHED")


def npm(*command, folder):
    """Return the output of an npm command; skip the test without access to the registry."""
    environment = {
        **os.environ,
        "npm_config_audit": "false",
        "npm_config_fund": "false",
        "npm_config_prefer_offline": "true",
        "npm_config_yes": "true",
    }
    done = subprocess.run(
        ["npm", *command],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=COMMAND_S,
    )
    said = done.stdout + done.stderr
    if done.returncode and any(f"code {code}" in said for code in OUT_OF_REACH):
        pytest.skip(f"npm {command[0]} cannot reach the registry")
    assert done.returncode == 0, said
    return done.stdout


def packed(folder):
    """Return the output of `npm pack`, in a folder."""
    built_package()
    with (PACKAGE / ".building").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        said = npm("pack", "--json", "--pack-destination", str(folder), folder=PACKAGE)
    return folder / json.loads(said)[0]["filename"]


def built_example(name, folder):
    """Build an example; return the files of its page by path."""
    project = folder / name
    shutil.copytree(EXAMPLES / name, project)
    described = json.loads((project / "package.json").read_text("utf-8"))
    described["dependencies"]["meshreel"] = f"file:{packed(folder)}"
    (project / "package.json").write_text(json.dumps(described), "utf-8")
    npm("install", folder=project)
    npm("run", "build", folder=project)
    return files_below(project / "dist")


def files_below(folder):
    """Return file contents by path, for a server."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {f"/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in paths}
