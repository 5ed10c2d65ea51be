"""Which structure: the simplest of those that explain recordings they were not fitted to as well as the best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.estimation.phases import Phase
from observer_rt.fit.held_out import UnexplainedSignal
from observer_rt.fit.search import FailedStructure, Fitted
from observer_rt.model.parameters import LineOutflow

MARGIN, WORST_MARGIN = (
    1.15,
    1.5,
)  # times the best chi2, of the mean and of a phase, up to which one is as good
NOISE = 0.03  # of a mean chi2 that is 1 for noise alone; what is below is chance


@dataclass(frozen=True)
class Choice:
    """The structure chosen, the others, and why, in words.

    as_good: those that explain the recordings as well, the one chosen among them.
    """

    best: Fitted
    tried: Sequence[Fitted | FailedStructure]
    as_good: Sequence[Fitted]
    reason: str

    @property
    def mass_spread(self) -> float:
        """By what share the mass differs, at most, between structures that do as well; 0 with one."""
        mass = _mass(self.best)
        return max(abs(_mass(one) / mass - 1.0) for one in self.as_good)


def judged_by(one: Fitted) -> UnexplainedSignal:
    """What a structure leaves of recordings it was not fitted to; of all, where none could be left out."""
    return one.left if one.held_out is None else one.held_out.unexplained


def choose(tried: Sequence[Fitted | FailedStructure]) -> Choice | None:
    """None where no structure could be fitted. Of equally good and simple ones that which conserves mass."""
    candidates = [one for one in tried if isinstance(one, Fitted)]
    if not candidates:
        return None
    lowest = min(candidates, key=lambda one: judged_by(one).mean)
    as_good = [one for one in candidates if _is_as_good(judged_by(one), judged_by(lowest))]
    best = min(
        as_good,
        key=lambda one: (
            len(one.calibration.free),
            one.structure.outflow is not LineOutflow.SEAT,
            judged_by(one).mean,
        ),
    )
    return Choice(best, tried, as_good, _reason(best, lowest, candidates, as_good))


def _is_as_good(one: UnexplainedSignal, best: UnexplainedSignal) -> bool:
    return one.mean <= MARGIN * best.mean + NOISE and all(
        not np.isfinite(best.chi2[phase]) or one.chi2[phase] <= WORST_MARGIN * max(best.chi2[phase], 1.0)
        for phase in Phase
    )


def _reason(best: Fitted, lowest: Fitted, candidates: Sequence[Fitted], as_good: Sequence[Fitted]) -> str:
    unseen = judged_by(best)
    where = "of recordings left out" if best.held_out is not None else "of the only injection there is"
    worse = [one for one in candidates if one not in as_good]
    words = [
        f"{best.structure.name}: chi2 {where} {unseen.mean:.2f} in the mean of the phases, "
        f"{unseen.chi2[unseen.worst]:.2f} at worst ({_phase(unseen.worst)})"
    ]
    if lowest is not best:
        words.append(
            f"{lowest.structure.name} has the lowest ({judged_by(lowest).mean:.2f}), but not {MARGIN - 1.0:.0%} "
            "less, and the simpler is taken"
        )
    equal = [one for one in as_good if one is not best and one is not lowest]
    words += [f"{one.structure.name} does as well ({judged_by(one).mean:.2f})" for one in equal]
    if worse:
        second = min(worse, key=lambda one: judged_by(one).mean)
        left = judged_by(second)
        phase = max(Phase, key=lambda p: np.nan_to_num(left.chi2[p] / max(unseen.chi2[p], 1.0)))
        words.append(
            f"the next, {second.structure.name}, leaves {left.chi2[phase]:.3g} in phase {_phase(phase)}"
        )
    return "; ".join(words)


def _phase(phase: Phase) -> str:
    return phase.name.lower()


def _mass(one: Fitted) -> float:
    return float(sum(part.masses.sum() for part in one.judged))
