"""A case as scored: what was hidden, what was answered, and what the definitions of the bars make of it."""

from dataclasses import dataclass

from tools.benchmarks.discovery.hidden import HEALTHY, same_effect

VISIBLE_GAIN = 50.0  # of the oracle's -2 log L
RELEVANT_MASS_MG, RELEVANT_PRESSURE_MPA = 0.3, 0.3  # one of them moves by that much
INSEPARABLE = 16.0  # difference of the oracle's -2 log L below which two effects are not told apart
MEANINGFUL_GAP = 0.1  # MPa or mg: below, a share of the gap says nothing
NONE, NAMED, AMBIGUOUS, UNKNOWN, SEVERAL = "none", "named", "ambiguous", "unknown", "several"


@dataclass(frozen=True)
class Visibility:
    """How visible what is hidden is on the recordings given, by the oracle.

    gain: what -2 log L falls with the true effect; mass_mg: largest change of an injection; pressure_mpa: largest rms
    change of the line pressure over an open phase.
    """

    gain: float
    mass_mg: float
    pressure_mpa: float
    beyond_dead_zone: bool

    @property
    def above_noise(self) -> bool:
        """Whether it must be named."""
        relevant = self.mass_mg >= RELEVANT_MASS_MG or self.pressure_mpa >= RELEVANT_PRESSURE_MPA
        return self.gain >= VISIBLE_GAIN and self.beyond_dead_zone and relevant


@dataclass(frozen=True)
class Gap:
    """Rms of model minus plant on noise-free inputs, on recordings `discover` never saw; MPa or mg."""

    before: float
    after: float
    oracle: float

    @property
    def share_left(self) -> float | None:
        """What is left of the gap, 0 as good as the oracle, 1 no better than before; None without a gap."""
        if self.before - self.oracle < MEANINGFUL_GAP:
            return None
        return (self.after - self.oracle) / (self.before - self.oracle)


@dataclass(frozen=True)
class Interval:
    """A 95 % interval of a rightly named parameter, SI."""

    name: str
    low: float
    high: float
    true: float

    @property
    def holds(self) -> bool:
        """Whether the true value is in it."""
        return self.low <= self.true <= self.high


@dataclass(frozen=True)
class CaseResult:
    """One case; the oracle's figures are None for a healthy one.

    claims: ids and confidences of findings.json; rivalry: by how much the oracle's -2 log L of each effect an
    ambiguous answer lists differs from that of the true one.
    """

    label: str
    effect: str
    values: tuple[float, ...]
    with_rate: bool
    verdict: str
    claims: tuple[tuple[str, float], ...]
    listed: tuple[str, ...]
    visibility: Visibility | None
    rivalry: tuple[tuple[str, float], ...]
    intervals: tuple[Interval, ...]
    line_pressure: Gap | None
    injected_mass: Gap | None
    seconds: float
    core_seconds: float

    @property
    def faulty(self) -> bool:
        """Whether something was hidden."""
        return self.effect != HEALTHY

    @property
    def above_noise(self) -> bool:
        """Whether what was hidden must be named."""
        return self.visibility is not None and self.visibility.above_noise

    @property
    def size(self) -> float:
        """Magnitude of the hidden effect's first parameter; 1 for a switch."""
        return abs(self.values[0]) if self.values else 1.0

    @property
    def named_right(self) -> bool:
        """Whether the one name given is the right one, or a member of its exact class."""
        return self.verdict == NAMED and len(self.claims) == 1 and same_effect(self.claims[0][0], self.effect)

    @property
    def ambiguous_right(self) -> bool:
        """Whether the ambiguity is real: it holds the right name, and the oracle cannot tell the others from it."""
        return (
            self.verdict == AMBIGUOUS
            and any(same_effect(listed, self.effect) for listed in self.listed)
            and all(abs(difference) < INSEPARABLE for _, difference in self.rivalry)
        )

    @property
    def right(self) -> bool:
        """Whether the answer counts as right."""
        return self.named_right or self.ambiguous_right if self.faulty else self.verdict == NONE

    @property
    def answer(self) -> str:
        """The column of the confusion matrix: the one name given, or the verdict."""
        if self.verdict != NAMED:
            return self.verdict
        return self.claims[0][0] if len(self.claims) == 1 else SEVERAL

    @property
    def confidences(self) -> tuple[tuple[float, bool], ...]:
        """Every name given with its confidence, and whether it is what was hidden."""
        return tuple((confidence, same_effect(name, self.effect)) for name, confidence in self.claims)
