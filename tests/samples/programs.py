"""Other programs, run in new processes."""

import os
import subprocess


def output_of(*command, timeout_s=300, environment=None, **options):
    """Run a program, which must succeed, with further environment variables; return its output."""
    done = subprocess.run(
        list(map(str, command)), capture_output=True, encoding="utf-8", timeout=timeout_s,
        env={**os.environ, **(environment or {})}, check=False, **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
