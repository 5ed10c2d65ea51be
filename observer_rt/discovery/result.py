"""What discovery found, as values: fitted effects, their rivals, what is left unexplained. SI throughout."""

from dataclasses import dataclass
from enum import StrEnum

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.phases import Phase
from observer_rt.model.effect import Equation


class Verdict(StrEnum):
    """The answer in one word."""

    NAMED = "named"
    NONE = "none"
    AMBIGUOUS = "ambiguous"
    UNKNOWN = "unknown"


class Signal(StrEnum):
    """A signal whose innovations are judged."""

    LINE_PRESSURE = "line_pressure"
    INJECTION_RATE = "injection_rate"


@dataclass(frozen=True)
class FittedParameter:
    """One parameter of an effect with its 95 % interval, SI."""

    name: str
    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class FittedEffect:
    """An effect in the model that won.

    gain: what -2 log L rises without it, the others refitted; confidence: probability that the name is right.
    """

    id: str
    parameters: tuple[FittedParameter, ...]
    gain: float
    confidence: float
    indistinguishable_from: tuple[str, ...]


@dataclass(frozen=True)
class Candidate:
    """A combination of effects fitted to all recordings; the nominal model is the one without effects.

    parameters: of every effect, in order; statistic: -2 log L, constants left out; held_out: the same, fitted on
    every second operating point and judged on the others, nan where that was not done; samples: independent
    innovations it rests on; beyond_dead_zone: every effect is.
    """

    ids: tuple[str, ...]
    parameters: tuple[tuple[FittedParameter, ...], ...]
    statistic: float
    held_out: float
    samples: float
    beyond_dead_zone: bool


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
class Decisive:
    """A measurement that would tell effects apart."""

    measurement: str
    separates: tuple[str, ...]


@dataclass(frozen=True)
class Discovery:
    """The answer to: which effect is missing?

    effects: of the winner, named (or, when ambiguous, the leading explanation; empty for `none` and `unknown`);
    rivals: combinations that explain the recordings as well; ranking: leaders, best first, with the nominal model;
    gain: of the winner over the nominal model, threshold: what it had to exceed; before, after: cells of the nominal
    model and of the winner; confidence: that the verdict is right.
    """

    verdict: Verdict
    effects: tuple[FittedEffect, ...]
    rivals: tuple[tuple[str, ...], ...]
    ranking: tuple[Candidate, ...]
    gain: float
    threshold: float
    confidence: float
    confidence_method: str
    unexplained: Unexplained | None
    decide_by: tuple[Decisive, ...]
    before: tuple[Cell, ...]
    after: tuple[Cell, ...]
    noise: NoiseLevels
    rate_noise: float  # m3/s, nan without measured rate
