"""`meshreel formats`: the supported file formats."""

from typing import Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import option


@command
@option("as_json", "--json", is_flag=True, help="Print the list as JSON.")
def formats_command(
    as_json: bool,
) -> None:
    """List the file formats, and the extras that install missing ones.

    Example:

    - `meshreel formats`
    """
    from meshreel.app.cli.console import print_columns, print_json
    from meshreel.formats.registry import described_formats

    formats = described_formats()
    if as_json:
        print_json({"formats": formats})
        return
    rows = [
        (
            row["extension"],
            row["title"],
            row["holds"],
            "yes" if row["reads"] else "no",
            _write_text(row),
            _installed_text(row),
        )
        for row in formats
    ]
    print_columns(
        "formats", ("extension", "format", "contents", "read", "write", "installed"), rows
    )


def _installed_text(row: dict[str, Any]) -> str:
    """Whether the library of a format is installed, or the command that installs it."""
    if row["is_installed"]:
        return "yes"
    command = f"pip install 'meshreel[{row['extra']}]'"
    return f"for reading; to write: {command}" if row["reads_without_extra"] else command


def _write_text(row: dict[str, Any]) -> str:
    """Whether a format can be written, and whether its faces may change."""
    if not row["writes"]:
        return "no"
    return "yes" if row["writes_changing_faces"] else "constant faces"
