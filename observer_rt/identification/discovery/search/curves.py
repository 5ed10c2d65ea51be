"""Laws made to measure: a free curve over one variable, a sum of hats, the simple form nearest to it, and waves."""

import math
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from observer_rt.foundation.units import Floats
from observer_rt.identification.discovery.search.scores import Scores
from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import TermLaw, term_effect
from observer_rt.model.terms.law import Law
from observer_rt.model.terms.parser import LETTERS, FormNumber, parse
from observer_rt.model.terms.term import TermEquation
from observer_rt.model.terms.variable import Variable

MOST_LAWS = 4  # made at once
MOST_OF_CURVE = 3  # over one variable, each of another shape
LOWEST, HIGHEST = 200.0, 0.4  # Hz, and share of the sample rate
ZERO_PADDING = 4  # times as many frequencies as samples
MEDIAN_WIDTH = 500.0  # Hz: width of the running median of the spectrum
LEAST_LINE_POWER = 8.0  # times the median: least power of a line
CLIPPED_RESIDUAL = 5.0  # standard deviations: residuals are clipped, since transients would hide an oscillation
LINE_DISTANCE = 50.0  # Hz: least distance of two lines
MOST_LINES = 2
GATES = (Variable.OPEN, Variable.CLOSED, Variable.OPENING, Variable.CLOSING)
WAVE_EQUATIONS = (TermEquation.RAIL_PRESSURE, TermEquation.LINE_PRESSURE_SENSOR, TermEquation.CHAMBER_PRESSURE)
"""Equations that may hold an oscillating term; not outflows, since fuel would flow back half of the time."""


class Shape(Enum):
    """Appearance of a simple law; the knots of a curve hardly distinguish two laws of one shape."""

    POWER = "power"
    KINK = "kink"
    STEP = "step"
    BUMP = "bump"
    RINGING = "ringing"
    SATURATION = "saturation"


@dataclass(frozen=True)
class Axis:
    """A variable u of curves, of order 1: `over` in the language of laws; knots: of its hats; of: its variables."""

    over: str
    knots: tuple[float, ...]
    of: Set[str]

    @cached_property
    def forms(self) -> tuple["Form", ...]:
        """Simple laws over the axis: no bumps over a pressure, for recordings have few of these."""
        start, span = self.knots[0], self.knots[-1] - self.knots[0]
        places = tuple(FormNumber(start + 0.1 * tenth * span, start, self.knots[-1]) for tenth in range(11))
        widths = tuple(FormNumber(w * span, 0.2 * w * span, 4.0 * w * span) for w in (0.02, 0.08, 0.2, 0.35))
        return (
            Form("max(u - A, 0)", (places[1:-1],), Shape.KINK),
            Form("max(A - u, 0)", (places[1:-1],), Shape.KINK),
            Form("(1 + tanh((u - A)/W))/2", (places[1:-1], widths[:3]), Shape.STEP),
            Form("tanh((u - A)/W)", (places[:-1], widths[1:3]), Shape.STEP),
            *([] if self is PRESSURE else [Form("exp(-((u - A)/W)^2)", (places, widths[1:]), Shape.BUMP)]),
            *(Form(law) for law in ("1", "u", "u*abs(u)", "u^3", "sqrt(u)")),
            *(Form(law, (widths,), Shape.SATURATION) for law in ("u/(abs(u) + A)", "1 - exp(-abs(u)/A)")),
            *(self._even_and_odd(places, widths) if self.knots[0] < 0.0 else ()),
            *([RINGING] if self is SINCE else []),
        )

    def _even_and_odd(self, places: tuple[FormNumber, ...], widths: tuple[FormNumber, ...]) -> tuple["Form", ...]:
        """Laws that are symmetric about 0, or antisymmetric."""
        right = tuple(one for one in places[:-1] if one.value > 0.0)
        return (
            Form("abs(u)"),
            Form("max(abs(u) - A, 0)", (right,), Shape.KINK),
            Form("max(u - A, 0) + min(u + A, 0)", (right,), Shape.KINK),
            Form("tanh(u/A)", (widths,), Shape.STEP),
        )

    @property
    def hat_laws(self) -> list[str]:
        """Laws that are 1 at one knot and 0 at its neighbours; the first and the last stay 1 beyond the knots."""
        laws = []
        for knot in range(len(self.knots)):
            shown = range(max(0, knot - 1), min(knot + 2, len(self.knots)))
            pairs = ", ".join(f"{self.knots[number]:g}, {float(number == knot):g}" for number in shown)
            laws.append(f"table({self.over}, {pairs})")
        return laws

    def hats(self, equation: TermEquation, factor: str = "") -> list[Effect]:
        """Hats as terms of an equation, with a factor before each."""
        return [term_effect(equation, factor + law) for law in self.hat_laws]


FLOW = Axis("line_flow/60", (-0.3, -0.1, 0.0, 0.1, 0.25, 0.5, 0.75, 1.0), {"line_flow"})
PRESSURE = Axis(
    "(line_pressure - 100)/50",
    (-1.0, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7, 1.0),
    {"line_pressure", "chamber_pressure"},
)
LIFT = Axis("needle_lift/max_lift", (0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0), {"needle_lift", "max_lift"})
SINCE = Axis("time_since_opening/1", (*(0.07 * number for number in range(19)), 1.5, 2.0), {"time_since_opening"})
OVER_NOZZLE = Axis(
    "(sac_pressure - chamber_pressure)/100",
    (0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.0, 1.3),
    {"sac_pressure", "chamber_pressure"},
)
OVER_SEAT = Axis(
    "(line_pressure - sac_pressure)/10", (0.0, 0.3, 0.7, 1.2, 2.0, 3.5, 6.0, 10.0), {"line_pressure", "sac_pressure"}
)
SPEED = Axis("lift_rate", (-0.5, -0.35, -0.2, -0.1, 0.1, 0.2, 0.35, 0.5), {"lift_rate"})
RATE = Axis("line_pressure_rate/50", (-1.5, -0.8, -0.3, -0.1, 0.1, 0.3, 0.8, 1.5), {"line_pressure_rate"})
AXES = (FLOW, PRESSURE, LIFT, SINCE, OVER_NOZZLE, OVER_SEAT, SPEED, RATE)
CURVES: Mapping[TermEquation, tuple[tuple[Axis, str], ...]] = {
    TermEquation.LINE_FLOW: ((FLOW, ""), (PRESSURE, "line_flow/60*")),
    TermEquation.INERTANCE: ((FLOW, ""), (PRESSURE, "")),
    TermEquation.STIFFNESS: ((PRESSURE, ""), (FLOW, ""), (LIFT, ""), (RATE, "")),
    TermEquation.LINE_PRESSURE: ((PRESSURE, ""), (LIFT, ""), (SPEED, "")),
    TermEquation.SEAT_FLOW: ((LIFT, ""), (LIFT, "closing*"), (LIFT, "opening*"), (SINCE, ""), (OVER_SEAT, "")),
    TermEquation.NOZZLE_FLOW: ((SINCE, ""), (LIFT, ""), (OVER_NOZZLE, ""), (PRESSURE, "")),
    TermEquation.CHAMBER_PRESSURE: ((SINCE, ""), (LIFT, ""), (OVER_NOZZLE, "")),
    TermEquation.NEEDLE_LIFT: ((LIFT, "open*"), (SPEED, "open*")),
    TermEquation.LINE_PRESSURE_SENSOR: ((PRESSURE, ""), (RATE, ""), (FLOW, "")),
}
"""Curves of an equation: over what, and a factor before it."""


def axis_of(law: Law) -> Axis | None:
    """The axis of a law beside its gates; None for a law that remembers or has variables of several axes."""
    words = {variable.word for variable in law.variables if variable not in GATES}
    return next((axis for axis in AXES if words and words <= axis.of and not law.remembers), None)


@dataclass(frozen=True)
class Form:
    """A law of a variable u; numbers: in the order of `LETTERS`, the values that are tried for each, with bounds."""

    law: str
    numbers: tuple[tuple[FormNumber, ...], ...] = ()
    shape: "Shape" = Shape.POWER

    def values(self, numbers: Sequence[FormNumber], knots: Floats) -> Floats:
        """Values of the law at knots (k,)."""
        text = self.law.replace("u", "time")
        for letter, number in zip(LETTERS, numbers, strict=False):
            text = text.replace(letter, f"({number.value!r})")
        return np.broadcast_to(_values_at(text, tuple(knots.tolist())), knots.shape)

    def over(self, axis: Axis) -> str:
        """The law over the variable of an axis."""
        return self.law.replace("u", f"({axis.over})")


# many curves share an axis, and with it all forms
_values_at = lru_cache(maxsize=16384)(lambda text, knots: parse(text).at({"time": np.array(knots)}))
RINGING = Form(
    "exp(-u/A)*sin(6.283185307*W*u + F)",
    (
        (FormNumber(0.3, 0.1, 2.0), FormNumber(1.0, 0.1, 4.0)),  # ms
        tuple(FormNumber(0.5 + 0.2 * step, 0.3 + 0.2 * step, 0.7 + 0.2 * step) for step in range(16)),  # kHz
        tuple(FormNumber(0.25 * eighth * math.pi, -4.0, 8.0) for eighth in range(4)),
    ),
    Shape.RINGING,
)
"""Laws that ring after every opening."""


class Curve(NamedTuple):
    """A curve in an equation over an axis, with a factor before it."""

    equation: TermEquation
    axis: Axis
    factor: str


@dataclass(frozen=True, eq=False)
class FreeCurve:
    """A curve of any shape, and the scores of its hats."""

    curve: Curve
    scores: Scores

    @property
    def knots(self) -> Floats:
        """Knots that the data determine (k,)."""
        return np.array(self.curve.axis.knots)[self.scores.numbers]


Score = Callable[[Sequence[Effect]], Scores]  # of effects beside the model at hand


def free_curves(curves: Sequence[Curve], score: Score) -> list[FreeCurve]:
    """Curves about a model, each hat linearised once."""
    parts = parts_of([axis.hats(equation, factor) for equation, axis, factor in curves], score)
    return [FreeCurve(curve, part) for curve, part in zip(curves, parts, strict=True) if part.numbers.size]


def parts_of(groups: Sequence[Sequence[Effect]], score: Score) -> list[Scores]:
    """Scores of every group of terms."""
    scores = score([effect for group in groups for effect in group])
    ends = np.cumsum([len(group) for group in groups])
    return [scores.part(range(int(end) - len(group), int(end))) for end, group in zip(ends, groups, strict=True)]


def made_to_measure(
    curves: Sequence[FreeCurve], swings: Sequence[tuple[Effect, Effect]], score: Score
) -> list[Effect]:
    """The terms that would gain most: forms near these curves, and waves; swings: sine and cosine of each wave."""
    promising = [law for curve in curves for law in _laws(curve)]
    for pair, part in zip(swings, parts_of(swings, score), strict=True):
        sizes = part.sizes(range(len(part.effects)))
        if sizes.size == 2:
            promising.append((float(sizes @ part.gradient), turned(pair[0], sizes.tolist())))
    promising.sort(key=lambda item: -item[0])
    return [effect for _, effect in promising[:MOST_LAWS]]


def _laws(curve: FreeCurve) -> list[tuple[float, Effect]]:
    """The best form of every shape near a curve, with its gain."""
    (equation, axis, factor), part, knots = curve.curve, curve.scores, curve.knots
    laws_by_shape: dict[Shape, tuple[float, Effect]] = {}
    for form in axis.forms:
        tried = list(product(*form.numbers))
        values = np.array([form.values(numbers, knots) for numbers in tried])
        gains = gains_of(values, part, equation)
        best = int(np.argmax(gains))
        law = form.over(axis)
        if form.shape not in laws_by_shape or gains[best] > laws_by_shape[form.shape][0]:
            laws_by_shape[form.shape] = (float(gains[best]), term_effect(equation, factor + law, tried[best]))
    return sorted(laws_by_shape.values(), key=lambda item: -item[0])[:MOST_OF_CURVE]


def gains_of(values: Floats, scores: Scores, equation: TermEquation) -> Floats:
    """Gains (k,) of laws by their values (k, m) at the knots of the hats scored, with sizes within their bounds."""
    weights = np.einsum("ij,jk,ik->i", values, scores.information, values)
    slopes = values @ scores.gradient
    sizes = np.divide(slopes, weights, out=np.zeros_like(slopes), where=weights > 0.0)
    sizes = np.clip(sizes, -equation.bounds[1], equation.bounds[1])
    return np.asarray(2.0 * sizes * slopes - sizes**2 * weights)


def waves(frequencies: Sequence[float], longest: float) -> list[tuple[Effect, Effect]]:
    """Sine and cosine terms of every frequency [Hz] in every equation; longest: longest recording [s]."""
    pairs = []
    for frequency in frequencies:
        # a recording of length T resolves a frequency to 1/T
        numbers = FormNumber(frequency, frequency - 1.0 / longest, frequency + 1.0 / longest)
        for equation in WAVE_EQUATIONS:
            sine, cosine = (
                term_effect(equation, "sin(6.283185307*A[Hz]*time + W)", (numbers, FormNumber(phase, -4.0, 4.0)))
                for phase in (0.0, 0.5 * math.pi)
            )
            pairs.append((sine, cosine))
    return pairs


def turned(sine: Effect, swings: Sequence[float]) -> Effect:
    """One term with a phase, for these amplitudes of the sine and cosine terms."""
    law = sine.apply
    assert isinstance(law, TermLaw)
    frequency, phase = law.numbers
    return term_effect(law.equation, law.form, (frequency, phase._replace(value=math.atan2(swings[1], swings[0]))))


def lines(left: Sequence[Floats], times: Sequence[Floats], interval: float) -> list[float]:
    """Frequencies [Hz] that stand out of residuals (n,) at times [s] on the grid (n,), the strongest first."""
    size = 1 << math.ceil(math.log2(ZERO_PADDING * max(one[-1] - one[0] for one in times) / interval))
    power = np.zeros(size // 2 + 1)
    for values, when in zip(left, times, strict=True):
        grid = np.zeros(size)
        samples = np.rint((when - when[0]) / interval).astype(np.int64)
        grid[samples] = np.clip(values, -CLIPPED_RESIDUAL, CLIPPED_RESIDUAL)
        power += np.abs(np.fft.rfft(grid)) ** 2
    step = 1.0 / (size * interval)
    coarse = 8  # every 8th bin is enough for the median
    background = np.repeat(median_filter(power[::coarse], max(3, round(MEDIAN_WIDTH / step / coarse))), coarse)
    power = np.where(power > LEAST_LINE_POWER * background[: power.size], power, 0.0)
    first, last = round(LOWEST / step), round(HIGHEST / (interval * step))
    power[:first] = power[last:] = 0.0
    frequencies: list[float] = []
    while len(frequencies) < MOST_LINES and power.any():
        top = int(np.argmax(power))
        frequencies.append(top * step)
        power[max(0, top - round(LINE_DISTANCE / step)) : top + round(LINE_DISTANCE / step)] = 0.0
    return frequencies
