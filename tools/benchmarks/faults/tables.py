"""What is printed of scenarios of faults, the same as data and as a figure, and the bars that are missed."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from observer_rt.foundation.units import MILLISECOND
from tools.benchmarks.faults import live
from tools.benchmarks.faults.run import KINDS, Results
from tools.benchmarks.faults.scenario import AND
from tools.benchmarks.faults.score import RECOVERY, FaultScore
from tools.benchmarks.report import NOTHING, Columns, Shown, table_of

FEWEST, VALID = 500, 0.98
SEVERAL = "several at once"


@dataclass(frozen=True)
class Summary:
    """Of scenarios; found_ms: median and largest; recovered: median and largest number of events; in_time: of those
    that have events after the fault, the share valid within `RECOVERY` of them; named: of those that gave a reason.
    """

    scenarios: int
    wrong_samples: int
    late_samples: int
    wrong_summaries: int
    found_ms: tuple[float, float] | None
    never_found: int
    recovered: tuple[float, int] | None
    in_time: float
    named: float | None
    free: int
    valid: float | None
    crashes: int


def summary(scores: Sequence[FaultScore]) -> Summary:
    """Of at least one."""
    found = [s.found_after / MILLISECOND for s in scores if s.found_after is not None]
    again = [s.recovered_after for s in scores if s.recovered_after is not None]
    named = [s.is_named for s in scores if s.is_named is not None]
    free = sum(s.free for s in scores)
    return Summary(
        len(scores),
        sum(s.wrong_samples for s in scores),
        sum(s.late_samples for s in scores),
        sum(s.wrong_summaries for s in scores),
        (float(np.median(found)), max(found)) if found else None,
        len(scores) - len(found),
        (float(np.median(again)), max(again)) if again else None,
        sum(each <= RECOVERY for each in again) / len(scores),
        float(np.mean(named)) if named else None,
        free,
        sum(s.free_valid for s in scores) / free if free else None,
        sum(bool(s.crash) for s in scores),
    )


def by_kind(scores: Sequence[FaultScore]) -> dict[str, Summary]:
    """Every kind alone, and those of several at once together."""
    groups: dict[str, list[FaultScore]] = {name: [] for name in (*KINDS, *live.KINDS, SEVERAL)}
    for each in scores:
        groups[SEVERAL if AND in each.class_name else each.class_name].append(each)
    return {name: summary(group) for name, group in groups.items() if group}


def missed_bars(results: Results) -> list[str]:
    """A line for every bar that is missed."""
    return list(_missed(results)) if results.scores else []


def shown(results: Results) -> Iterator[Shown]:
    """Every kind a line, the total, and what is missed."""
    if results.scores:
        rows = {**by_kind(results.scores), "all": summary(results.scores)}
        yield table_of("Faults at random times", "fault", rows, _COLUMNS)
    yield from missed_bars(results)
    yield from (f"crash: {s.label}: {s.crash}" for s in results.scores if s.crash)
    yield from (f"not run: {crash.task}: {crash.message}" for crash in results.crashes)


def faults_document(results: Results) -> dict[str, Any]:
    """`figures` over all scenarios, `details` by kind and of each that was wrong."""
    return {
        "figures": asdict(summary(results.scores)) if results.scores else None,
        "details": {
            "kinds": {name: asdict(each) for name, each in by_kind(results.scores).items()},
            "wrong": [asdict(s) for s in results.scores if s.wrong_samples or s.wrong_summaries or s.crash],
            "violations": missed_bars(results),
            "not_run": [str(crash) for crash in results.crashes],
        },
    }


def save_figure(results: Results, path: Path) -> None:
    """Time until a fault was found, and events until one was valid again, a line a kind, a dot a scenario."""
    alone = [name for name, each in by_kind(results.scores).items() if name != SEVERAL]
    figure = Figure(figsize=(10, 0.24 * len(alone) + 1.5), layout="constrained")
    found, again = figure.subplots(1, 2, sharey=True)
    for row, name in enumerate(alone):
        ours = [s for s in results.scores if s.class_name == name]
        times = [s.found_after / MILLISECOND for s in ours if s.found_after is not None]
        found.plot(np.maximum(times, 0.01), [row] * len(times), ".", color="tab:blue", alpha=0.5)
        events = [s.recovered_after for s in ours if s.recovered_after is not None]
        again.plot(events, [row] * len(events), ".", color="tab:green", alpha=0.5)
    found.set(xscale="log", xlabel="first sample not valid, ms after the fault", yticks=range(len(alone)))
    found.set_yticklabels(alone, fontsize=7)
    found.invert_yaxis()
    again.axvline(RECOVERY + 0.5, color="tab:red", linewidth=0.8)
    again.set(xlabel="events after the fault until one is valid")
    figure.savefig(path, dpi=150)


def _missed(results: Results) -> Iterator[str]:
    total = summary(results.scores)
    bars: tuple[tuple[bool, str], ...] = (
        (total.scenarios >= FEWEST, f"{total.scenarios} scenarios, {FEWEST} are asked for"),
        (total.crashes == 0, f"{total.crashes} crashes"),
        (total.wrong_samples == 0, f"{total.wrong_samples} samples valid and wrong beyond the stated time"),
        (total.wrong_summaries == 0, f"{total.wrong_summaries} injections valid and wrong"),
        (
            (total.valid or 0.0) >= VALID,
            f"{100 * (total.valid or 0.0):.1f} % valid without a fault, {VALID:.0%} asked",
        ),
        (total.in_time == 1.0, f"{100 * total.in_time:.1f} % valid again within {RECOVERY} events"),
        (total.named in (None, 1.0), f"{100 * (total.named or 0.0):.1f} % named"),
    )
    yield from (f"missed: {text}" for is_met, text in bars if not is_met)


_COLUMNS: Columns[Summary] = {
    "scenarios": lambda s: str(s.scenarios),
    "wrong while valid: samples, injections": lambda s: f"{s.wrong_samples}, {s.wrong_summaries}",
    "within the stated time": lambda s: str(s.late_samples),
    "found after, ms: median, most": lambda s: (
        NOTHING if s.found_ms is None else f"{s.found_ms[0]:.2g}, {s.found_ms[1]:.3g}"
    ),
    "valid throughout": lambda s: str(s.never_found),
    "valid again after events: median, most": lambda s: (
        NOTHING if s.recovered is None else f"{s.recovered[0]:g}, {s.recovered[1]}"
    ),
    "within 3": lambda s: f"{s.in_time:.0%}",
    "cause named": lambda s: NOTHING if s.named is None else f"{s.named:.0%}",
    "valid without a fault": lambda s: NOTHING if s.valid is None else f"{100 * s.valid:.1f} %",
    "crashes": lambda s: str(s.crashes),
}
