"""What discovery found, as values: fitted effects, their rivals, what is left unexplained. SI throughout."""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from observer_rt.discovery.search.hypothesis import Hypothesis
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.phases import Phase
from observer_rt.evidence.pooled import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effective import EffectiveModel


class Verdict(StrEnum):
    """The answer in one word."""

    NAMED = "named"
    NONE = "none"
    AMBIGUOUS = "ambiguous"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class FittedParameter:
    """One parameter of an effect with its 95 % interval, SI."""

    name: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Consequence:
    """By how much a model moves: root mean square of the line pressure from opening to the end of the ringing [Pa],
    and mean of the injected mass [kg], over all events."""

    line_pressure: float
    mass: float


@dataclass(frozen=True)
class FittedEffect:
    """An effect found.

    gain: what -2 log L rises without it, the others refitted; moves: what it does when it comes last.
    """

    id: str
    parameters: tuple[FittedParameter, ...]
    gain: float
    indistinguishable_from: tuple[str, ...]
    moves: Consequence


@dataclass(frozen=True)
class Candidate:
    """A combination of effects fitted to all recordings; the nominal model is the one without effects.

    sizes: (p,), SI, effect after effect; statistic: -2 log L, constants left out. Of those in a ranking also half:
    half widths of the 95 % intervals (p,); held_out: -2 log L fitted on every second operating point and judged on
    the others, nan where that was not done; moves: what it does to the model as given.
    """

    hypothesis: Hypothesis
    sizes: tuple[float, ...]
    statistic: float
    half: tuple[float, ...] = ()
    held_out: float = math.nan
    moves: Consequence = Consequence(0.0, 0.0)

    @property
    def theta(self) -> NDArray[np.float64]:
        """The sizes as a vector (p,)."""
        return np.array(self.sizes)

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the effects."""
        return self.hypothesis.ids

    @property
    def plausible(self) -> bool:
        """Whether every effect has a size that matters and that no bound holds back."""
        return self.hypothesis.is_plausible(self.theta)

    @property
    def within_bounds(self) -> bool:
        """Whether no bound holds a size back."""
        return self.hypothesis.is_within_bounds(self.theta)

    @property
    def parameters(self) -> tuple[tuple[FittedParameter, ...], ...]:
        """The parameters of every effect, their intervals cut at the bounds of physics."""
        every = zip(self.hypothesis.parameters, self.sizes, self.half, strict=True)
        fitted = (
            FittedParameter(p.name, value, (max(p.lowest, value - half), min(p.highest, value + half)))
            for p, value, half in every
        )
        return tuple(tuple(islice(fitted, len(effect.parameters))) for effect in self.hypothesis.effects)

    def model(self, nominal: EffectiveModel) -> EffectiveModel:
        """The nominal model with these effects."""
        return self.hypothesis.model(nominal, self.theta)

    def model_without(self, number: int, nominal: EffectiveModel) -> EffectiveModel:
        """The nominal model with all but one of these effects, the others at their sizes."""
        parts = zip(self.hypothesis.effects, self.hypothesis.split(self.theta), strict=True)
        for effect, sizes in (part for i, part in enumerate(parts) if i != number):
            nominal = Hypothesis((effect,)).model(nominal, sizes)
        return nominal


@dataclass(frozen=True)
class Decisive:
    """A measurement that would tell effects apart."""

    measurement: str
    separates: tuple[str, ...]


@dataclass(frozen=True)
class Cell:
    """Innovations of one signal in one phase at one operating point (recording).

    variance, colour: mean square of the normalised innovations and of their scaled block means, 1 when adequate;
    excess: how improbable the larger is for white noise, in standard deviations; rms: of the innovations (SI).
    """

    signal: Signal
    phase: Phase
    recording: int
    rail_pressure: float  # Pa
    duration: float  # s, needle open
    samples: int
    variance: float
    colour: float
    excess: float
    rms: float


@dataclass(frozen=True)
class Unexplained:
    """Where the best model still fails and what its excess depends on."""

    equation: Equation
    phase: Phase
    signal: Signal
    depends_on: tuple[str, ...]
    term: str


@dataclass(frozen=True)
class SmallestVisible:
    """The size [SI] from which on an effect would have been seen in these recordings, by its first parameter."""

    id: str
    parameter: str
    size: float


@dataclass(frozen=True)
class Discovery:
    """The answer to: which effect is missing?

    named: the winner, or the leading explanation when ambiguous; without effects for `none` and `unknown`; best: the
    same, but for `unknown` what explains most, which is not enough; effects: those of the named; rivals: combinations
    that explain the recordings as well; ranking: leaders, best first, with the nominal model; samples: independent
    innovations all this rests on; gain: of the winner over the nominal model, threshold: what it had to exceed;
    before, after: cells of the nominal model and of the best; confidence: that the verdict is right;
    smallest_visible: of every effect that has a size.
    """

    verdict: Verdict
    named: Candidate
    best: Candidate
    effects: tuple[FittedEffect, ...]
    rivals: tuple[tuple[str, ...], ...]
    ranking: tuple[Candidate, ...]
    samples: float
    gain: float
    threshold: float
    confidence: float
    confidence_method: str
    unexplained: Unexplained | None
    decide_by: tuple[Decisive, ...]
    before: tuple[Cell, ...]
    after: tuple[Cell, ...]
    noise: NoiseLevels
    rate_noise: float | None  # m3/s, None without a measured rate
    smallest_visible: tuple[SmallestVisible, ...] = ()
