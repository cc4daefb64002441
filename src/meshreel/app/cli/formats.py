"""`meshreel formats`: file formats that can be read and written."""

from typing import Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import option


@command
@option("as_json", "--json", is_flag=True, help="Print the list as JSON.")
def formats_command(
    as_json: bool,
) -> None:
    """List the file formats, and the extra that installs each missing one.

    Example:

    - `meshreel formats`
    """
    from meshreel.app.cli.console import print_columns, print_json
    from meshreel.formats.registry import described_formats

    found = described_formats()
    if as_json:
        print_json({"formats": found})
        return
    rows = [
        (
            one["extension"],
            one["title"],
            one["holds"],
            "yes" if one["reads"] else "no",
            _written(one),
            "yes" if one["is_installed"] else f"pip install 'meshreel[{one['extra']}]'",
        )
        for one in found
    ]
    print_columns("formats", ("extension", "format", "a file holds", "read", "write", "here"), rows)


def _written(one: dict[str, Any]) -> str:
    """Whether a format is written, and whether its faces may change."""
    if not one["writes"]:
        return "no"
    return "yes" if one["writes_changing_faces"] else "constant faces"
