"""What is printed of disturbed recordings, the same as data, and the bars that are missed."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from tools.benchmarks.realism.catalogue import AND, STATED, alone, name_of
from tools.benchmarks.realism.score import Results, RunScore, Summary, Verdict, summary
from tools.benchmarks.report import NOTHING, Shown

RIGHT_SHARE = 0.85
REASONS_SHOWN = 3


def by_entry(runs: Sequence[RunScore]) -> dict[str, Summary]:
    """Of every entry that has runs, in their order."""
    names = dict.fromkeys(run.class_name for run in runs)
    return {name: summary([run for run in runs if run.class_name == name]) for name in names}


def missed_bars(results: Results) -> list[str]:
    """A line for every bar that is missed."""
    return list(_missed(results.runs)) if results.runs else []


def shown(results: Results) -> Iterator[Shown]:
    """Every entry a line, the totals, the bars that are missed, what could not be run."""
    if results.runs:
        yield _entries_table(by_entry(results.runs))
        yield _totals_table(_groups(results.runs))
    yield from missed_bars(results)
    yield from (f"{name}: not run, this observer's bench file has no such key" for name in results.not_known)
    yield from (f"crash: {crash.task}: {crash.message}" for crash in results.crashes)


def realism_document(results: Results) -> dict[str, Any]:
    """`figures` over all runs, `details` per entry."""
    total = summary(results.runs) if results.runs else None
    return {
        "figures": None if total is None else _figures(total),
        "details": {
            "groups": {name: _figures(each) for name, each in _groups(results.runs).items()},
            "entries": {name: asdict(each) for name, each in by_entry(results.runs).items()},
            "violations": missed_bars(results),
            "not_known": list(results.not_known),
            "crashes": [str(crash) for crash in results.crashes],
        },
    }


def _figures(total: Summary) -> dict[str, Any]:
    refused = total.verdicts[Verdict.REFUSED]
    return {
        "right_share": total.share(Verdict.RIGHT),
        "refused_share": total.share(Verdict.REFUSED),
        "rough_share": total.share(Verdict.ROUGH),
        "wrong_valid": total.wrong_valid,
        "runs": total.runs,
        "events": total.events,
        "valid_share": total.valid_share,
        "mass_p95_pct": total.mass_p95_pct,
        "coverage_95_share": total.coverage,
        "true_refusal_share": total.true_refusals / refused if refused else None,
        "healthy": total.healthy,
        "falsely_worn": total.falsely_worn,
        "false_wear_max": total.false_wear_max,
        "ukf_mass_p95_pct": total.ukf_p95_pct,
    }


def _groups(runs: Sequence[RunScore]) -> dict[str, Summary]:
    table = {name_of(entry) for entry in alone(table=True)}
    groups = {
        "the table's": [run for run in runs if run.class_name in table],
        "alone": [run for run in runs if AND not in run.class_name],
        "in pairs": [run for run in runs if AND in run.class_name],
        "all": list(runs),
    }
    return {name: summary(members) for name, members in groups.items() if members}


def _missed(runs: Sequence[RunScore]) -> Iterator[str]:
    table = {name_of(entry) for entry in alone(table=True)}
    for name, each in by_entry(runs).items():
        if each.wrong_valid:
            yield f"{name}: {each.wrong_valid} events valid and wrong"
        # what needs a statement in the bench file to be right may be refused truly without it
        elif (
            name in table
            and not each.is_right
            and not (name + STATED in table and each.true_refusals == each.verdicts[Verdict.REFUSED])
        ):
            yield f"{name}: not right, although in the table"
        if each.falsely_worn and AND not in name:
            often = f"in {each.falsely_worn} of {each.healthy} healthy recordings"
            yield f"{name}: wear {each.false_wear_max:.2g} beyond its interval {often}"
    total = summary(runs)
    if total.share(Verdict.RIGHT) < RIGHT_SHARE:
        yield f"all: {total.share(Verdict.RIGHT):.0%} right < {RIGHT_SHARE:.0%}"
    if total.true_refusals < (refused := total.verdicts[Verdict.REFUSED]):
        yield f"all: {refused - total.true_refusals} of {refused} refused for what is not true"


def _entries_table(entries: dict[str, Summary]) -> Table:
    table = _table(
        "events 8-20; reasons with * are not true of the disturbance; UKF: the joint UKF, which never refuses",
        ("disturbance", "came to", *_HEADINGS),
    )
    table.add_column("reasons of what is not valid")
    for name, each in entries.items():
        table.add_row(name, _came_to(each), *_cells(each), _reasons(each))
    return table


def _totals_table(groups: dict[str, Summary]) -> Table:
    table = _table("in all", ("", "runs", *Verdict, "events\nwrong", "of", "refused\ntruly", *_HEADINGS))
    for name, each in groups.items():
        counts = (each.runs, *(each.verdicts[v] for v in Verdict), each.wrong_valid, each.events)
        table.add_row(name, *map(str, counts), str(each.true_refusals), *_cells(each))
    return table


def _table(title: str, headings: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading in headings:
        table.add_column(heading, justify="right" if table.columns else "left")
    return table


_HEADINGS = ("valid\n%", "mass %\np95", "\nmax", "cover\n%", "false\nwear", "UKF %\np95")


def _came_to(each: Summary) -> str:
    """Its verdicts, in a few words."""
    found = [(verdict, each.verdicts[verdict]) for verdict in Verdict if each.verdicts[verdict]]
    return ", ".join(verdict if len(found) == 1 else f"{count} {verdict}" for verdict, count in found)


def _cells(each: Summary) -> list[str]:
    return [
        f"{100.0 * each.valid_share:.0f}",
        _number(each.mass_p95_pct),
        _number(each.mass_max_pct),
        NOTHING if each.coverage is None else f"{100.0 * each.coverage:.0f}",
        f"{each.falsely_worn}/{each.healthy}" if each.healthy else NOTHING,
        _number(each.ukf_p95_pct),
    ]


def _number(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.2f}"


def _reasons(each: Summary) -> str:
    most = list(each.reasons.items())[:REASONS_SHOWN]
    return ", ".join(f"{name}{'*' if name in each.untrue else ''} {count}" for name, count in most)
