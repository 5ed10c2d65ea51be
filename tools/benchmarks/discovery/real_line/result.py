"""A case on a real line as scored: what was hidden, what was answered, and what the bars make of it."""

import math
from dataclasses import dataclass

from tools.benchmarks.discovery.hidden import same_effect
from tools.benchmarks.discovery.real_line.cases import Kind
from tools.benchmarks.discovery.real_line.hidden import Parts
from tools.benchmarks.discovery.result import AMBIGUOUS, NAMED, NONE, UNKNOWN, Interval

CONFIDENT = 0.9
SURELY_VISIBLE = 3.0  # times the smallest visible size: from there on an effect must be named
PRESSURE_TOLERANCE_MPA, MASS_TOLERANCE_MG, GAP_TOLERANCE = (
    0.003,
    0.02,
    0.02,
)  # by which a gap may grow, or its share
NEAR_TIES = (
    frozenset({"seat_area", "lift_gain", "lift_offset", "lift_dependent_seat_coefficient"}),
    frozenset({"line_pressure_sensor_lag", "channel_skew"}),
    frozenset({"channel_skew", "rail_pressure_skew", "needle_lift_sensor_lag"}),
    frozenset(
        {"rail_pressure_sensor_gain", "rail_pressure_sensor_offset", "line_pressure_sensor_offset"},
    ),
    frozenset({"fuel_density", "orifice_area", "seat_area"}),
)
"""Effects that differ by little at some sizes: an answer that leaves one of a group open may leave all of it open."""


@dataclass(frozen=True)
class RealGap:
    """Rms of model minus plant on noise-free inputs of unseen recordings; MPa or mg.

    before: of the fitted model; true: with what is hidden in it at its true sizes, the best that naming can do: what
    the fitted model is off by may happen to cancel against an effect.
    """

    before: float
    after: float
    true: float

    def larger(self, tolerance: float) -> bool:
        """Whether the amended model is worse by more than a tolerance in its unit, and by more than its share."""
        least = max(self.before, self.true)
        return self.after > least + max(tolerance, GAP_TOLERANCE * least)


@dataclass(frozen=True)
class RealResult:
    """One case; smallest: what findings.json says could have been seen of each effect's first parameter, SI.

    Gaps are None where no amended model was written.
    """

    label: str
    kind: Kind
    discrepancy: str
    with_rate: bool
    parts: Parts
    verdict: str
    claims: tuple[tuple[str, float], ...]
    listed: tuple[str, ...]
    smallest: tuple[tuple[str, float], ...]
    intervals: tuple[Interval, ...]
    line_pressure: RealGap | None
    injected_mass: RealGap | None
    seconds: float
    core_seconds: float

    @property
    def effects(self) -> tuple[str, ...]:
        """What is hidden."""
        return tuple(name for name, _ in self.parts)

    @property
    def counted(self) -> bool:
        """Whether it must be answered rightly: what is hidden is well above what can be seen."""
        smallest = dict(self.smallest)
        return self.kind in (Kind.HEALTHY, Kind.OUTSIDE) or all(
            abs(values[0]) >= SURELY_VISIBLE * smallest.get(name, 0.0) for name, values in self.parts
        )

    @property
    def named_right(self) -> bool:
        """Whether all effects hidden were named, or members of their exact classes, and nothing else."""
        names = [name for name, _ in self.claims]
        return (
            self.verdict == NAMED
            and len(names) == len(self.parts)
            and all(self._is_hidden(name) for name in names)
            and all(any(same_effect(name, effect) for name in names) for effect in self.effects)
        )

    @property
    def ambiguous_right(self) -> bool:
        """Whether an ambiguous answer lists all that is hidden; of one effect, beside its near ties only."""
        if self.verdict != AMBIGUOUS or not self.parts:
            return False
        lists_all = all(any(same_effect(name, effect) for name in self.listed) for effect in self.effects)
        near = self.kind is not Kind.SINGLE or all(near_tie(name, self.effects[0]) for name in self.listed)
        return lists_all and near

    @property
    def right(self) -> bool:
        """Whether the answer counts as right."""
        if self.kind is Kind.HEALTHY:
            return self.verdict == NONE
        if self.kind is Kind.OUTSIDE:
            return self.verdict == UNKNOWN
        return self.named_right or self.ambiguous_right

    @property
    def half_right(self) -> bool:
        """Whether one of two effects was named, without or beside another name."""
        named = self.verdict == NAMED and any(self._is_hidden(name) for name, _ in self.claims)
        return self.kind is Kind.PAIR and not self.right and named

    @property
    def wrong_and_sure(self) -> bool:
        """Whether something that is not there was named with confidence."""
        return self.verdict == NAMED and any(
            confidence >= CONFIDENT and not self._is_hidden(name) for name, confidence in self.claims
        )

    @property
    def named_unsure(self) -> bool:
        """Whether something was named, nothing with confidence."""
        return self.verdict == NAMED and all(confidence < CONFIDENT for _, confidence in self.claims)

    @property
    def gap_larger(self) -> bool:
        """Whether the amended model is further from the plant than the fitted one, in either signal."""
        pressure, mass = self.line_pressure, self.injected_mass
        return (pressure is not None and pressure.larger(PRESSURE_TOLERANCE_MPA)) or (
            mass is not None and mass.larger(MASS_TOLERANCE_MG)
        )

    def times_smallest(self, effect: str) -> float:
        """Size of a hidden effect, in multiples of the smallest visible one; inf where none is stated."""
        smallest = dict(self.smallest).get(effect, 0.0)
        size = abs(dict(self.parts)[effect][0])
        return size / smallest if smallest > 0.0 else math.inf

    def _is_hidden(self, name: str) -> bool:
        return any(same_effect(name, effect) for effect in self.effects)


def near_tie(name: str, effect: str) -> bool:
    """Whether an effect may stand beside the true one in an ambiguous answer."""
    return same_effect(name, effect) or any({name, effect} <= group for group in NEAR_TIES)
