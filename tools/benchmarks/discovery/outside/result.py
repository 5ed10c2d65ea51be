"""A case outside the vocabulary as scored, and the bars that many of them have to meet."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tools.benchmarks.discovery.hidden import (
    MOMENTUM,
    NOZZLE,
    OUTFLOW,
    SENSOR,
    STIFFNESS,
    Family,
    TermEquation,
)
from tools.benchmarks.discovery.outside.answers import Misfit, OutsideAnswer, Proposed
from tools.benchmarks.discovery.outside.cases import Asked, OutsideCase
from tools.benchmarks.discovery.outside.kinds import ACTS_IN, VOCABULARY_KINDS, kind_named
from tools.benchmarks.discovery.real_line.result import near_tie
from tools.benchmarks.discovery.result import NAMED
from tools.benchmarks.report import Figure

CONFIDENT = 0.9
HALVED = 0.5
MEANINGFUL_MASS_MG = 0.3
WORSE_MG, WORSE_SHARE = 0.1, 0.2  # by both of which a mass must be further off to count as worse
VIOLATED = {
    "line_flow": MOMENTUM - {TermEquation.RAIL_PRESSURE},
    "line_pressure": OUTFLOW | STIFFNESS | {TermEquation.NOZZLE_FLOW},
    "sac_pressure": frozenset({TermEquation.SEAT_FLOW}),
    "input": frozenset({TermEquation.RAIL_PRESSURE, TermEquation.NEEDLE_LIFT}) | NOZZLE,
    "output": SENSOR,
}
"""What an equation said to be violated may stand for."""


@dataclass(frozen=True)
class OutsideResult:
    """A case, opened, and its answer."""

    case: OutsideCase
    answer: OutsideAnswer

    @property
    def label(self) -> str:
        """Of the case."""
        return self.case.label

    @property
    def in_library(self) -> bool:
        """Whether the true law is among those a term can have."""
        return kind_named(self.case.name).in_library

    @property
    def best(self) -> Proposed | None:
        """The proposal that leads."""
        return self.answer.proposals[0] if self.answer.proposals else None

    @property
    def proposed_equations(self) -> Family:
        """Where the terms of the leading proposal stand, and the effects beside them."""
        if self.best is None:
            return frozenset()
        of_effects = (VOCABULARY_KINDS[name].equation for name in self.best.effects)
        return frozenset((*(TermEquation(term.equation) for term in self.best.terms), *of_effects))

    @property
    def accepted(self) -> bool:
        """Whether the leading proposal may enter an amended model."""
        return self.best is not None and self.best.may_enter

    @property
    def right_equation(self) -> bool:
        """Whether all that is proposed stands where the true law does, or where these signals do not tell it."""
        return bool(self.proposed_equations) and self.proposed_equations <= self._equations()

    @property
    def exact_equation(self) -> bool:
        """Whether something proposed stands in the true law's own equation."""
        return kind_named(self.case.name).equation in self.proposed_equations

    @property
    def right_phase(self) -> bool | None:
        """Whether the phase said to fail most is one in which the law acts; None where it acts in all."""
        acts = ACTS_IN.get(self.case.name)
        return None if acts is None or self.best is None else self.best.phase in acts

    @property
    def right_suspicion(self) -> bool:
        """Whether an unknown effect is said to violate an equation it may violate."""
        return bool(VIOLATED.get(self.answer.suspect, frozenset()) & self._equations())

    @property
    def after(self) -> Misfit:
        """Of what would be believed: the leading proposal, else what was named."""
        return self.answer.named if self.best is None else self.best.misfit

    @property
    def pressure_halved(self) -> bool:
        """Whether the gap of the line pressure is."""
        return self.after.pressure_mpa <= HALVED * self.answer.before.pressure_mpa

    @property
    def mass_halved(self) -> bool | None:
        """Whether the gap of the mass is, but for the model's own; None where it never mattered."""
        own = self.answer.own.mass_mg
        before, after = self.answer.before.mass_mg - own, self.after.mass_mg - own
        return after <= HALVED * before if before > MEANINGFUL_MASS_MG else None

    @property
    def accepted_worse(self) -> bool:
        """Whether a proposal that may enter is further off in mass than the model as given."""
        before, after = self.answer.before.mass_mg, self.after.mass_mg
        return self.accepted and after > before + WORSE_MG and after > (1.0 + WORSE_SHARE) * before

    @property
    def rightly_named(self) -> bool:
        """Whether the vocabulary's search ends with what is hidden, or a near tie, whatever is proposed besides."""
        names = self.answer.by_vocabulary
        return len(names) == 1 and near_tie(names[0], self.case.name)

    @property
    def wrong_and_sure(self) -> bool:
        """Whether something that is not there was named with confidence; near ties of an effect do not count."""
        named = self.answer.verdict == NAMED and self.answer.confidence >= CONFIDENT
        return named and any(not near_tie(claim, self.case.name) for claim in self.answer.claims)

    @property
    def as_good(self) -> bool:
        """Whether an effect whose name was taken away is found by a term, or by the name of a near tie."""
        tied = self.answer.verdict == NAMED and not self.wrong_and_sure and self.best is None
        return (self.right_equation or tied) and self.pressure_halved

    @property
    def added_seconds(self) -> float:
        """What came after the search with the vocabulary."""
        return self.answer.seconds - self.answer.search_seconds

    def _equations(self) -> Family:
        return kind_named(self.case.name).equations(self.case.with_rate)


Results = Sequence[OutsideResult]


def asked_for(results: Results, asked: Asked) -> list[OutsideResult]:
    """Cases of an asking."""
    return [r for r in results if r.case.asked is asked]


def share(flags: Iterable[bool | None]) -> float | None:
    """Share of those that hold, None left out; None without any."""
    known = [flag for flag in flags if flag is not None]
    return float(np.mean(known)) if known else None


Share = Callable[[OutsideResult], bool | None]
"""Whether a result is what a share is of; None: it is not asked."""


def figures(results: Results, tier: str) -> list[Figure]:
    """What is judged, with the bars of a tier."""
    of = {asked: asked_for(results, asked) for asked in Asked}
    known, new = ([r for r in of[Asked.OUTSIDE] if r.in_library is flag] for flag in (True, False))
    named = [r for r in of[Asked.NAMED] if r.rightly_named]
    at_least: tuple[tuple[str, Results, Share, float, float], ...] = (
        ("right_equation_in_library", known, lambda r: r.right_equation, 0.95, 0.85),
        ("right_equation_not_in_library", new, lambda r: r.right_equation, 0.80, 0.65),
        ("pressure_halved_in_library", known, lambda r: r.pressure_halved, 0.95, 0.80),
        ("pressure_halved_not_in_library", new, lambda r: r.pressure_halved, 0.85, 0.75),
        ("mass_halved_in_library", known, lambda r: r.mass_halved, 0.90, 0.75),
        ("mass_halved_not_in_library", new, lambda r: r.mass_halved, 0.75, 0.60),
        ("left_out_as_good", of[Asked.LEFT_OUT], lambda r: r.as_good, 0.85, 0.70),
    )
    at_most: tuple[tuple[str, Results, Share, float, float], ...] = (
        ("accepted_mass_worse", [r for r in results if r.accepted], lambda r: r.accepted_worse, 0.02, 0.04),
        ("wrong_and_sure", results, lambda r: r.wrong_and_sure, 0.03, 0.05),
        ("proposed_to_healthy", of[Asked.HEALTHY], lambda r: r.best is not None, 0.0, 0.02),
        ("proposed_to_rightly_named", named, lambda r: r.best is not None, 0.03, 0.06),
    )
    place = "AB".index(tier)
    found = [
        Figure(name, share(map(of_result, cases)), f"{len(cases)} cases", at_least=bars[place])
        for name, cases, of_result, *bars in at_least
    ]
    found += [
        Figure(name, share(map(of_result, cases)), f"{len(cases)} cases", bars[place])
        for name, cases, of_result, *bars in at_most
    ]
    slowest = max((r.answer.added_core_seconds for r in results), default=None)
    return [
        *found,
        Figure("added_core_seconds_max", slowest, "after the vocabulary's search", (10.0, 25.0)[place]),
    ]
