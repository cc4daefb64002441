"""`meshreel formats`: the supported file formats."""

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_columns, print_json
from meshreel.app.cli.messages import print_line
from meshreel.app.cli.parameters import JsonOption


@command
def formats_command(
    as_json: JsonOption = False,
) -> None:
    """List the file formats, and the extras that install missing ones.

    Example:

    - `meshreel formats`
    """
    from meshreel.formats.registry import described_formats

    formats = described_formats()
    if as_json:
        print_json({"formats": formats})
        return
    rows = []
    for row in formats:
        writes = "yes" if row["writes_changing_faces"] else "constant faces"
        extra = f"[{row['extra']}], to write" if row["reads_without_extra"] else f"[{row['extra']}]"
        rows.append(
            (
                row["extension"],
                row["title"],
                row["holds"],
                "yes" if row["reads"] else "no",
                writes if row["writes"] else "no",
                "yes" if row["is_installed"] else extra,
            )
        )
    print_columns(
        "formats", ("extension", "format", "contents", "read", "write", "installed"), rows
    )
    missing = [row["extra"] for row in formats if not row["is_installed"]]
    if missing:
        print_line(
            f"[{missing[0]}] is an extra: pip install 'meshreel[{missing[0]}]'; "
            "'meshreel[formats]' installs all of them"
        )
