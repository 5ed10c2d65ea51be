"""What came of one disturbed recording: right, refused, rough or wrong; and of many."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.realism.catalogue import parsed, true_reasons
from tools.benchmarks.runs import Crash, Task
from tools.benchmarks.score import OBSERVER, UKF, WRONG_MASS, CaseScore

JUDGED = slice(7, 20)  # events 8-20
ENOUGH_VALID = 0.8
CLOSE_PCT, CLOSE_PERCENTILE = 1.0, 95.0
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

    def errors_pct(self, name: str = OBSERVER) -> NDArray[np.float64]:
        """Sizes of the mass errors of events 8-20."""
        return np.abs(self.case.event_errors_pct(name)[JUDGED])

    @property
    def valid_errors_pct(self) -> NDArray[np.float64]:
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
        return Verdict.RIGHT if _percentile(self.valid_errors_pct) <= CLOSE_PCT else Verdict.ROUGH

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
        beyond = [max(_beyond(interval) for interval in pair) for pair in pairs]
        lasting = sum(each > 0.0 for each in beyond) > LASTING * len(beyond)
        return max(beyond) if lasting else 0.0


@dataclass(frozen=True)
class Results:
    """What came out; not_known: entries whose keys of the bench file this observer does not know."""

    runs: tuple[RunScore, ...]
    crashes: tuple[Crash[Task], ...]
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
        mass_p95_pct=_percentile(errors) if errors.size else None,
        mass_max_pct=float(errors.max()) if errors.size else None,
        coverage=float(np.mean(covered)) if covered else None,
        healthy=sum(run.wear == 0.0 for run in runs),
        falsely_worn=sum(run.false_wear > 0.0 for run in runs),
        false_wear_max=max(run.false_wear for run in runs),
        true_refusals=sum(not run.untrue for run in refused),
        reasons=dict(sum((run.refusals for run in runs), Counter[str]()).most_common()),
        untrue=dict(sum((run.untrue for run in runs), Counter[str]()).most_common()),
        ukf_p95_pct=_percentile(np.concatenate(theirs)) if theirs else None,
    )


def _beyond(interval: Interval) -> float:
    """How far an interval is from 0."""
    return 0.0 if interval is None else max(interval[0], -interval[1], 0.0)


def _percentile(errors: NDArray[np.float64]) -> float:
    return float(np.percentile(errors, CLOSE_PERCENTILE))
