#!/usr/bin/env bash
# Test with the lowest version of every dependency that pyproject.toml allows, on the lowest Python.
#
#     tests/check_floors.sh                 # all unit tests
#     tests/check_floors.sh tests/unit/cli  # or other arguments of pytest
#
# Run it after changes of pyproject.toml or of imports. It takes minutes, needs python3.11 and the
# network, and leaves no files behind. Indirect dependencies have the newest version that fits.
set -euo pipefail
cd "$(dirname "$0")/.."

python=${PYTHON:-python3.11}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m venv "$work/uv"
"$work/uv/bin/pip" install --quiet uv

"$work/uv/bin/uv" venv --quiet --python "$python" "$work/lowest"
source "$work/lowest/bin/activate"
"$work/uv/bin/uv" pip install --quiet --resolution lowest-direct '.[test-all]'
"$work/uv/bin/uv" pip list
pytest -rs "${@:-tests/unit}"
