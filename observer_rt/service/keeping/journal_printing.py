"""What a journal says, as tables, CSV and JSON."""

import csv
import json
import sys
from typing import Any

from rich.table import Table

from observer_rt.service.keeping.journal import SCHEMA
from observer_rt.service.keeping.journal_columns import COLUMNS, WEAR, Value
from observer_rt.service.keeping.journal_reading import JournalFile, Mean, Row, Span
from observer_rt.terminal.console import results

SPANS = 12  # of the table of wear


def print_csv(content: JournalFile, last: int | None) -> None:
    """All injections, or the last ones, on stdout."""
    names = ["run", *(column.name for column in COLUMNS)]
    writer = csv.DictWriter(sys.stdout, names, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(content.injections(last))


def print_json(content: JournalFile, last: int | None) -> None:
    """One document on stdout: the runs, and all injections or the last ones."""
    document = {
        "schema": SCHEMA,
        "runs": [_run_json(run) for run in content.runs()],
        "injections": [_injection_json(row) for row in content.injections(last)],
    }
    print(json.dumps(document, indent=2))


def print_tables(content: JournalFile, last: int) -> None:
    """The wear over time, and the last injections."""
    console = results()
    runs = content.runs()
    killed = sum(run["stopped_utc"] is None for run in runs)
    since = f" since {runs[0]['started_utc']} UTC" if runs else ""
    console.print(
        f"injections: {content.count()}{since}; runs: {len(runs)}, {killed} of them killed or still running",
        highlight=False,
    )
    wear = Table(
        "until (UTC)",
        "injections",
        "valid",
        "rail MPa",
        *(each.name for each in WEAR),
        title="Wear over time: means of the valid injections, with their 95 % intervals",
    )
    for span in content.spans(SPANS):
        wear.add_row(*_span_cells(span))
    newest = Table(
        "judged (UTC)",
        "no.",
        "rail MPa",
        "mass mg",
        *(each.name for each in WEAR),
        "valid",
        title="Last injections",
    )
    for row in content.injections(last):
        newest.add_row(*_injection_cells(row))
    console.print(wear, newest)


def _run_json(run: Row) -> dict[str, Any]:
    configuration = json.loads(str(run["configuration_json"]))
    return {name: value for name, value in run.items() if name != "configuration_json"} | {
        "configuration": configuration
    }


def _injection_json(row: Row) -> dict[str, Any]:
    reasons = str(row["reasons"])
    return {**row, "valid": bool(row["valid"]), "reasons": reasons.split(",") if reasons else []}


def _span_cells(span: Span) -> list[str]:
    return [
        span.until_utc,
        str(span.injections),
        f"{100 * span.valid / span.injections:.0f} %",
        f"{span.lowest_rail_MPa:.0f} to {span.highest_rail_MPa:.0f}",
        *(_mean_cell(mean) for mean in span.wear),
    ]


def _mean_cell(mean: Mean) -> str:
    if mean.value is None:
        return "-"
    return f"{mean.value:+.3f}" + ("" if mean.low is None else f" [{mean.low:+.3f}, {mean.high:+.3f}]")


def _injection_cells(row: Row) -> list[str]:
    return [
        str(row["judged_utc"]),
        str(row["number"]),
        _number(row["rail_pressure_MPa"], ".1f"),
        _number(row["mass_mg"], ".2f"),
        *(_number(row.get(each.value), "+.3f") for each in WEAR),
        "yes" if row["valid"] else str(row["reasons"]),
    ]


def _number(value: Value, form: str) -> str:
    return format(value, form) if isinstance(value, int | float) else "-"
