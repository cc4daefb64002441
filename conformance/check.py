"""Whether the core decodes every stream of the folders to its stored description.

`python -m conformance.check` prints what differs. With `--make` all streams are made again too, so
that what encodes them is run; the results are thrown away. Another build of the core is chosen with
the environment variable MESHREEL_CORE.
"""

import argparse
import json
import sys

from conformance import segments
from conformance.by_core import given_by_core, read_all_by_core
from conformance.description import describe_all
from conformance.make import FOLDER, STREAMS


def plain(description):
    """A description as JSON gives it back."""
    return json.loads(json.dumps(description))


def wanted(name, folder=FOLDER):
    """The stored description of a stream."""
    return json.loads((folder / f"{name}.json").read_text("utf-8"))


def differences(name, read_all, given=dict, folder=FOLDER):
    """Names of values that `read_all` finds in a stream and that differ from its description.

    `given` is the part of a description that `read_all` gives.
    """
    found = plain(describe_all(read_all((folder / f"{name}.reel").read_bytes())))
    said = given(wanted(name, folder))
    return sorted(key for key in found | said if found.get(key) != said.get(key))


def main():
    """Check all streams; exit with 1 if one differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--make", action="store_true", help="make all streams again, too")
    given = parser.parse_args()
    failed = False
    for streams, folder in ((STREAMS, FOLDER), (segments.STREAMS, segments.FOLDER)):
        for name, make in streams.items():
            if different := differences(name, read_all_by_core, given_by_core, folder):
                print(f"{name}: {', '.join(different)}")
                failed = True
            if given.make:
                make()
    sys.exit(failed)


if __name__ == "__main__":
    main()
