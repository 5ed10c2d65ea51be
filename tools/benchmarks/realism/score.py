"""What came of a disturbed recording: right, refused, rough or wrong; of many; tables, data, bars that are missed."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from tests.plants.arrays import Array
from tools.benchmarks.campaign import Found, Task
from tools.benchmarks.realism.catalogue import AND, STATED, alone, name_of, parsed, true_reasons
from tools.benchmarks.report import NOTHING, Columns, Shown, cells, crash_lines, mean, percentile
from tools.benchmarks.score import OBSERVER, UKF, WRONG_MASS, CaseScore

JUDGED = slice(7, 20)  # events 8-20
ENOUGH_VALID = 0.8
CLOSE_PCT = 1.0  # of 95 %
RIGHT_SHARE = 0.85
REASONS_SHOWN = 3
LASTING = 0.5  # share of the judged events from which wear is claimed, not seen by chance

Interval = tuple[float, float] | None


class Verdict(StrEnum):
    """What a recording came to."""

    RIGHT = "right"  # enough events valid, and close
    REFUSED = "refused"  # too few events valid, none wrong
    ROUGH = "rough"  # enough events valid, none wrong, but not close
    WRONG = "wrong"  # a valid event beyond 3 %, or one that never was


@dataclass(frozen=True)
class RunScore(Task):
    """A recording scored; tuples are per event.

    wear: true v_H; nozzle_ci95, seat_ci95: 95 % intervals of v_H, v_S; phantoms: valid injections without an opening
    of the needle.
    """

    wear: float
    case: CaseScore
    nozzle_ci95: tuple[Interval, ...]
    seat_ci95: tuple[Interval, ...]
    phantoms: int

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Of events 8-20."""
        return np.array(self.case.valid[JUDGED])

    def errors_pct(self, name: str = OBSERVER) -> Array:
        """Sizes of the mass errors of events 8-20."""
        return np.abs(self.case.event_errors_pct(name)[JUDGED])

    @property
    def valid_errors_pct(self) -> Array:
        """The same of the valid ones."""
        return self.errors_pct()[self.valid]

    @property
    def wrong_valid(self) -> int:
        """Valid events beyond 3 %, of the whole recording, and valid injections that never were."""
        wrong = np.abs(self.case.event_errors_pct()) > WRONG_MASS
        return int(np.sum(wrong & np.array(self.case.valid))) + self.phantoms

    @property
    def verdict(self) -> Verdict:
        """See `Verdict`."""
        if self.wrong_valid:
            return Verdict.WRONG
        if np.mean(self.valid) < ENOUGH_VALID:
            return Verdict.REFUSED
        return Verdict.RIGHT if percentile(self.valid_errors_pct, 95) <= CLOSE_PCT else Verdict.ROUGH

    @property
    def refusals(self) -> Counter[str]:
        """Reasons of those of events 8-20 that are not valid, by how many have each."""
        given = (r for r, v in zip(self.case.reasons[JUDGED], self.valid, strict=True) if not v)
        return Counter(name for reasons in given for name in (reasons or "NONE").split())

    @property
    def untrue(self) -> Counter[str]:
        """Of these, reasons that are not true of the disturbance."""
        true = true_reasons(parsed(self.class_name))
        return Counter({name: count for name, count in self.refusals.items() if name not in true})

    @property
    def covered(self) -> list[bool]:
        """Whether the 95 % interval of the mass holds the truth, of the valid ones among events 8-20."""
        numbers = np.flatnonzero(self.valid) + JUDGED.start
        return [c for n in numbers if (c := self.case.covered(int(n))) is not None]

    @property
    def false_wear(self) -> float:
        """By how much wear of a healthy injector is beyond its interval, in most of events 8-20; 0: it is not."""
        if self.wear != 0.0:
            return 0.0
        pairs = zip(self.nozzle_ci95[JUDGED], self.seat_ci95[JUDGED], strict=True)
        beyond = [max(max(i[0], -i[1], 0.0) if i else 0.0 for i in pair) for pair in pairs]  # how far from 0
        lasting = sum(each > 0.0 for each in beyond) > LASTING * len(beyond)
        return max(beyond) if lasting else 0.0


@dataclass(frozen=True)
class Results(Found[RunScore]):
    """not_known: entries whose keys of the bench file this observer does not know."""

    not_known: tuple[str, ...]


@dataclass(frozen=True)
class Summary:
    """Runs of one entry, or of many; shares are of the runs, or of their events 8-20. None: nothing to tell it by.

    falsely_worn, false_wear_max: of the healthy ones, those with wear, and how far it is beyond its interval;
    true_refusals: refused runs of which every reason is true.
    """

    runs: int
    events: int
    verdicts: dict[str, int]
    wrong_valid: int
    valid_share: float
    mass_p95_pct: float | None
    mass_max_pct: float | None
    coverage: float | None
    healthy: int
    falsely_worn: int
    false_wear_max: float
    true_refusals: int
    reasons: dict[str, int]
    untrue: dict[str, int]
    ukf_p95_pct: float | None

    def share(self, verdict: Verdict) -> float:
        """Of the runs."""
        return self.verdicts[verdict] / self.runs

    @property
    def is_right(self) -> bool:
        """Whether all events together are right: enough valid, close, none wrong."""
        return (
            not self.wrong_valid
            and self.valid_share >= ENOUGH_VALID
            and self.mass_p95_pct is not None
            and self.mass_p95_pct <= CLOSE_PCT
        )


def summary(runs: Sequence[RunScore]) -> Summary:
    """Of at least one run."""
    verdicts = Counter(run.verdict for run in runs)
    errors = np.concatenate([run.valid_errors_pct for run in runs])
    covered = [c for run in runs for c in run.covered]
    refused = [run for run in runs if run.verdict is Verdict.REFUSED]
    theirs = [run.errors_pct(UKF) for run in runs if run.case.has(UKF)]
    return Summary(
        runs=len(runs),
        events=sum(run.valid.size for run in runs),
        verdicts={verdict: verdicts[verdict] for verdict in Verdict},
        wrong_valid=sum(run.wrong_valid for run in runs),
        valid_share=float(np.mean(np.concatenate([run.valid for run in runs]))),
        mass_p95_pct=percentile(errors, 95),
        mass_max_pct=percentile(errors, 100),
        coverage=mean(covered),
        healthy=sum(run.wear == 0.0 for run in runs),
        falsely_worn=sum(run.false_wear > 0.0 for run in runs),
        false_wear_max=max(run.false_wear for run in runs),
        true_refusals=sum(not run.untrue for run in refused),
        reasons=dict(sum((run.refusals for run in runs), Counter[str]()).most_common()),
        untrue=dict(sum((run.untrue for run in runs), Counter[str]()).most_common()),
        ukf_p95_pct=percentile(np.concatenate(theirs), 95) if theirs else None,
    )


def by_entry(runs: Sequence[RunScore]) -> dict[str, Summary]:
    """Of every entry that has runs, in their order."""
    names = dict.fromkeys(run.class_name for run in runs)
    return {name: summary([run for run in runs if run.class_name == name]) for name in names}


def missed_bars(results: Results) -> list[str]:
    """A line for every bar that is missed."""
    return list(_missed(results.results)) if results.results else []


def shown(results: Results) -> Iterator[Shown]:
    """Every entry a line, the totals, the bars that are missed, what could not be run."""
    if results.results:
        title = "events 8-20; reasons with * are not true of the disturbance; UKF: the joint UKF, which never refuses"
        yield _plain_table(title, "disturbance", by_entry(results.results), _ENTRY_COLUMNS)
        yield _plain_table("in all", "", _groups(results.results), _TOTAL_COLUMNS)
    yield from missed_bars(results)
    yield from (f"{name}: not run, this observer's bench file has no such key" for name in results.not_known)
    yield from crash_lines(results.crashes)


def realism_document(results: Results) -> dict[str, Any]:
    """`figures` over all runs, `details` per entry."""
    total = summary(results.results) if results.results else None
    return {
        "figures": None if total is None else _figures(total),
        "details": {
            "groups": {name: _figures(each) for name, each in _groups(results.results).items()},
            "entries": {name: asdict(each) for name, each in by_entry(results.results).items()},
            "violations": missed_bars(results),
            "not_known": list(results.not_known),
            "crashes": list(results.crashes),
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


_COLUMNS: Columns[Summary] = {
    "valid\n%": "{.valid_share!p:.0f}",
    "mass %\np95": "{.mass_p95_pct:.2f}",
    "\nmax": "{.mass_max_pct:.2f}",
    "cover\n%": "{.coverage!p:.0f}",
    "false\nwear": lambda each: f"{each.falsely_worn}/{each.healthy}" if each.healthy else NOTHING,
    "UKF %\np95": "{.ukf_p95_pct:.2f}",
}


def _came_to(each: Summary) -> str:
    """Its verdicts, in a few words."""
    found = [(verdict, each.verdicts[verdict]) for verdict in Verdict if each.verdicts[verdict]]
    return ", ".join(verdict if len(found) == 1 else f"{count} {verdict}" for verdict, count in found)


def _reasons(each: Summary) -> str:
    most = list(each.reasons.items())[:REASONS_SHOWN]
    return ", ".join(f"{name}{'*' if name in each.untrue else ''} {count}" for name, count in most)


_ENTRY_COLUMNS: Columns[Summary] = {
    "came to": _came_to,
    **_COLUMNS,
    "reasons of what is not valid": _reasons,
}
_TOTAL_COLUMNS: Columns[Summary] = {
    "runs": "{.runs}",
    **{str(verdict): f"{{.verdicts[{verdict}]}}" for verdict in Verdict},
    "events\nwrong": "{.wrong_valid}",
    "of": "{.events}",
    "refused\ntruly": "{.true_refusals}",
    **_COLUMNS,
}


def _plain_table(title: str, name: str, rows: dict[str, Summary], columns: Columns[Summary]) -> Table:
    """Without lines, for it has many rows and columns."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading in (name, *columns):
        table.add_column(heading, justify="right" if heading in _TOTAL_COLUMNS else "left")
    for each, row in rows.items():
        table.add_row(each, *cells(row, columns))
    return table
