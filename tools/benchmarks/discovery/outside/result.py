"""A case outside the vocabulary as scored, and the bars that many of them have to meet."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.outside.answers import Misfit, OutsideAnswer, Proposed
from tools.benchmarks.discovery.outside.cases import Asked, OutsideCase
from tools.benchmarks.discovery.outside.kinds import (
    MOMENTUM,
    NOZZLE,
    OUTFLOW,
    SENSOR,
    STIFFNESS,
    Family,
    TermEquation,
    kind_named,
)
from tools.benchmarks.discovery.real_line.result import near_tie
from tools.benchmarks.discovery.result import NAMED

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
    def accepted(self) -> bool:
        """Whether the leading proposal may enter an amended model."""
        return self.best is not None and self.best.may_enter

    @property
    def right_equation(self) -> bool:
        """Whether all terms proposed stand where the true law is, or where these signals do not tell them from it."""
        equations = self._equations()
        return self.best is not None and all(term.equation in equations for term in self.best.terms)

    @property
    def exact_equation(self) -> bool:
        """Whether a term proposed stands in the true law's own equation."""
        equation = kind_named(self.case.name).equation
        return self.best is not None and any(term.equation == equation for term in self.best.terms)

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
        """Whether the gap of the mass is; None where it never mattered."""
        before = self.answer.before.mass_mg
        return self.after.mass_mg <= HALVED * before if before > MEANINGFUL_MASS_MG else None

    @property
    def accepted_worse(self) -> bool:
        """Whether a proposal that may enter is further off in mass than the model as given."""
        before, after = self.answer.before.mass_mg, self.after.mass_mg
        return self.accepted and after > before + WORSE_MG and after > (1.0 + WORSE_SHARE) * before

    @property
    def rightly_named(self) -> bool:
        """Whether the one name given is that of what is hidden."""
        claims = self.answer.claims
        return self.answer.verdict == NAMED and len(claims) == 1 and same_effect(claims[0], self.case.name)

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


def share(flags: Sequence[bool | None]) -> float:
    """Share of those that hold, None left out; nan without any."""
    known = [flag for flag in flags if flag is not None]
    return float(np.mean(known)) if known else math.nan


@dataclass(frozen=True)
class Bar:
    """A figure and its limits in tier A and B; at_least: it must not be below, else not above."""

    name: str
    limits: tuple[float, float]
    figure: Callable[[Results], float]
    at_least: bool = True
    unit: str = "%"

    def limit(self, tier: str) -> float:
        """Of a tier."""
        return self.limits["AB".index(tier)]

    def met(self, value: float, tier: str) -> bool:
        """Whether it is; so is one that nothing was measured for."""
        limit = self.limit(tier)
        return math.isnan(value) or (value >= limit if self.at_least else value <= limit)

    def shown(self, value: float) -> str:
        """A value as it is printed."""
        if math.isnan(value):
            return "-"
        return f"{100.0 * value:.0f} %" if self.unit == "%" else f"{value:.1f} {self.unit}"


def _outside(results: Results, in_library: bool) -> list[OutsideResult]:
    return [r for r in asked_for(results, Asked.OUTSIDE) if r.in_library is in_library]


def _of_outside(in_library: bool, flag: Callable[[OutsideResult], bool | None]) -> Callable[[Results], float]:
    return lambda results: share([flag(r) for r in _outside(results, in_library)])


def _proposed(results: Results) -> float:
    return share([r.best is not None for r in results])


BARS = (
    Bar("right equation, law in the library", (0.95, 0.85), _of_outside(True, lambda r: r.right_equation)),
    Bar("right equation, law not in it", (0.80, 0.65), _of_outside(False, lambda r: r.right_equation)),
    Bar("pressure gap halved, in the library", (0.95, 0.80), _of_outside(True, lambda r: r.pressure_halved)),
    Bar("pressure gap halved, not in it", (0.85, 0.75), _of_outside(False, lambda r: r.pressure_halved)),
    Bar("mass gap halved, in the library", (0.90, 0.75), _of_outside(True, lambda r: r.mass_halved)),
    Bar("mass gap halved, not in it", (0.75, 0.60), _of_outside(False, lambda r: r.mass_halved)),
    Bar(
        "accepted, mass worse",
        (0.02, 0.04),
        lambda results: share([r.accepted_worse for r in results if r.accepted]),
        at_least=False,
    ),
    Bar(
        "wrong name, and sure",
        (0.03, 0.05),
        lambda results: share([r.wrong_and_sure for r in results]),
        at_least=False,
    ),
    Bar(
        "proposed to a healthy one",
        (0.0, 0.02),
        lambda results: _proposed(asked_for(results, Asked.HEALTHY)),
        at_least=False,
    ),
    Bar(
        "proposed to what is rightly named",
        (0.03, 0.06),
        lambda results: _proposed([r for r in asked_for(results, Asked.NAMED) if r.rightly_named]),
        at_least=False,
    ),
    Bar(
        "name taken away, as good",
        (0.85, 0.70),
        lambda results: share([r.as_good for r in asked_for(results, Asked.LEFT_OUT)]),
    ),
    Bar(
        "added to the search, at most",
        (10.0, 25.0),
        lambda results: max((r.added_seconds for r in results), default=math.nan),
        at_least=False,
        unit="s",
    ),
)


def violations(results: Results, tier: str) -> Iterator[str]:
    """A line for every bar that is missed."""
    for bar in BARS:
        value = bar.figure(results)
        if not bar.met(value, tier):
            relation = "<" if bar.at_least else ">"
            yield f"{bar.name}: {bar.shown(value)} {relation} {bar.shown(bar.limit(tier))}"
