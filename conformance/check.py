"""Whether the core decodes every stream of the folder to what is said beside it.

`python -m conformance.check` prints what differs. With `--make` all streams are made again too, so
that what encodes them is run; the results are thrown away. Another build of the core is chosen with
the environment variable MESHREEL_CORE.
"""

import argparse
import json
import sys

from conformance.by_core import given_by_core, read_by_core
from conformance.description import describe
from conformance.make import FOLDER, STREAMS


def plain(description):
    """A description as JSON gives it back."""
    return json.loads(json.dumps(description))


def wanted(name):
    """What is said of a stream."""
    return json.loads((FOLDER / f"{name}.json").read_text("utf-8"))


def differences(name, read, given=dict):
    """Names of what `read` finds otherwise in a stream than the part of a description it gives."""
    found = plain(describe(read((FOLDER / f"{name}.reel").read_bytes())))
    said = given(wanted(name))
    return sorted(key for key in found | said if found.get(key) != said.get(key))


def main():
    """Check all streams; exit with 1 if one differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--make", action="store_true", help="make all streams again, too")
    given = parser.parse_args()
    found = {name: differences(name, read_by_core, given_by_core) for name in STREAMS}
    failed = {name: different for name, different in found.items() if different}
    for name, different in failed.items():
        print(f"{name}: {', '.join(different)}")
    for make in STREAMS.values() if given.make else ():
        make()
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
