"""What discovery says of every injector, for the screen."""

from typing import Any

import pyarrow as pa
from rich.table import Table
from rich.text import Text

_HEADINGS = ("injector", "verdict", "what is missing", "line pressure off [MPa]", "recordings", "but")


def answer_table(answers: pa.Table) -> Table:
    """A row an injector, in the order of the table (columns of `discovered.SCHEMA`)."""
    table = Table(box=None, padding=(0, 3, 0, 0), pad_edge=False)
    for heading in _HEADINGS:
        table.add_column(Text(heading, style="bold"), overflow="fold")
    for row in answers.to_pylist():
        table.add_row(*map(Text, (row["injector"], *_cells(row))))
    return table


def _cells(row: dict[str, Any]) -> tuple[str, str, str, str, str]:
    if row["verdict"] is None:
        return "-", "-", "-", str(row["recordings"]), row["problem"].splitlines()[0]
    missing = f"{row['effects']}: {row['sizes']}" if row["sizes"] else row["effects"] or "-"
    if row["rivals"]:
        missing += f", or {row['rivals']}"
    but = [row["caveats"]] * bool(row["caveats"])
    if row["left_out"]:
        but.append(f"{row['left_out']} recordings left out")
    return (
        f"{row['verdict']} ({row['confidence']:.2f})",
        missing,
        _off(row),
        f"{row['judged']} of {row['recordings']}",
        "; ".join(but) or "-",
    )


def _off(row: dict[str, Any]) -> str:
    before, after = (row[f"line_pressure_{when}_MPa"] for when in ("before", "after"))
    if before is None:
        return "-"
    return f"{before:.2g} -> {after:.2g}" if row["effects"] and after is not None else f"{before:.2g}"
