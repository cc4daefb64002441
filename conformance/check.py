"""Check that the core decodes every stored stream to its description.

`python -m conformance.check` prints differences. With `--make` all streams are also encoded again,
to run the encoder; the results are discarded. The environment variable MESHREEL_CORE selects
another build of the core.
"""

import argparse
import json
import sys

from conformance import segments
from conformance.by_core import read_all_by_core, reported_by_core
from conformance.description import describe_all
from conformance.make import FOLDER, STREAMS


def plain(description):
    """Return a description as read back from JSON."""
    return json.loads(json.dumps(description))


def stored_description(name, folder=FOLDER):
    return json.loads((folder / f"{name}.json").read_text("utf-8"))


def differences(name, read_all, select=dict, folder=FOLDER):
    """Return the keys in which the decoded stream differs from its stored description.

    `select` returns the part of a description that `read_all` can reproduce.
    """
    decoded = plain(describe_all(read_all((folder / f"{name}.reel").read_bytes())))
    stored = select(stored_description(name, folder))
    return sorted(key for key in decoded | stored if decoded.get(key) != stored.get(key))


def main():
    """Check all streams; exit with status 1 if any differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--make", action="store_true", help="also encode all streams again")
    arguments = parser.parse_args()
    failed = False
    for streams, folder in ((STREAMS, FOLDER), (segments.STREAMS, segments.FOLDER)):
        for name, make in streams.items():
            if different := differences(name, read_all_by_core, reported_by_core, folder):
                print(f"{name}: {', '.join(different)}")
                failed = True
            if arguments.make:
                make()
    sys.exit(failed)


if __name__ == "__main__":
    main()
