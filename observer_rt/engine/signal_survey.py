"""Survey of signals while a file is read, and refusal of those that are no injector's, most often of another unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIMETRE, Floats

if TYPE_CHECKING:
    from pathlib import Path

SWAPPED = (  # problem and remedy
    "rail_pressure falls lower and rises higher than line_pressure: most likely the two are swapped",
    "compare their columns or signals: the line's pressure drops while the needle is open, and rings",
)
PRESSURES = (5 * MEGAPASCAL, 400 * MEGAPASCAL)  # Pa, highest of a common-rail system that injects
LARGEST_LIFT = 2 * MILLIMETRE
NEAR_ZERO = 0.1  # of the highest value: the lift of a shut needle is below it, a pressure at rest above
OPEN = 20 * MICROMETRE  # lift of an injection, above any noise
SMALLEST_LIFT = 5 * MICROMETRE  # highest lift, below which its unit is in doubt
SHAPE = 20.0  # highest value over the mean step from sample to sample, beyond which a signal is no noise
SAME = 0.2  # relative, within which a ratio of pressures is a ratio of units
FURTHER = 0.03  # of the mean, by which no rail pressure goes beyond the line's at both ends
RESTS_OPEN = 0.7  # mean lift over the highest, beyond which a lift is inverted: no needle is open most of the time
_PRESSURE_FACTORS = (  # Factors on the values that are in a unit although MPa was stated.
    (1e-6, "Pa"),
    (1e-3, "kPa"),
    (0.1, "bar"),
    (0.00689476, "psi"),
    (10.0, "MPa, if read as bar"),
    (1e3, "MPa, if read as kPa"),
    (1e6, "MPa, if read as Pa"),
)
_LIFT_FACTORS = ((1e-3, "um"), (1e-6, "nm"), (1e3, "mm, if read as um, or m, if read as mm"))


@dataclass
class SignalSurvey:
    """Survey of one signal (SI); missing: samples that are NaN."""

    lowest: float = math.inf
    highest: float = -math.inf
    total: float = 0.0
    count: int = 0
    missing: int = 0
    gaps: int = 0
    """Runs of missing samples."""
    change: float = 0.0
    """Sum of the changes from sample to sample, without their signs."""

    def take(self, values: Floats) -> None:
        """Go on with further samples (n,)."""
        is_there = ~np.isnan(values)
        present = values[is_there]
        self.gaps += int(np.count_nonzero(np.diff(is_there, prepend=True) & ~is_there))
        self.missing += values.size - present.size
        self.count += present.size
        if present.size:
            self.lowest = min(self.lowest, float(present.min()))
            self.highest = max(self.highest, float(present.max()))
            with np.errstate(over="ignore", invalid="ignore"):  # what is infinite, or so large, is refused
                self.total += float(present.sum())
                self.change += float(np.abs(np.diff(present)).sum())

    @property
    def mean(self) -> float:
        """Mean of the values; NaN without any."""
        return self.total / self.count if self.count else math.nan

    @property
    def as_missing(self) -> str:
        """Describes how much is missing."""
        return f"{self.missing} of {self.missing + self.count} values are missing, in {self.gaps} gaps"

    @property
    def swing(self) -> float:
        """Difference of the highest and the lowest value; 0 without any."""
        return max(0.0, self.highest - self.lowest)


class Openings:
    """Count of a lift's rises, not less than the observer's openings.

    Its dead band (2 um at least) follows the noise by factors of two, so that an opening rises through some level.
    """

    _LEVELS: Floats = np.array([2e-6 * 2.0**i for i in range(11)])  # m

    def __init__(self) -> None:
        self._counts = np.zeros(self._LEVELS.size, np.int64)
        self._last = 0.0

    def take(self, lift: Floats) -> None:
        """Go on with further samples (n,) [m]; those that are NaN are passed over."""
        values = lift[~np.isnan(lift)]
        before = np.append(self._last, values[:-1])[: values.size]
        rises = np.flatnonzero((values > before) & (values > self._LEVELS[0]))
        low, high = before[rises, None], values[rises, None]
        self._counts += np.count_nonzero((low <= self._LEVELS) & (high > self._LEVELS), axis=0)
        self._last = float(values[-1]) if values.size else self._last

    @property
    def most(self) -> int:
        """Most openings that there can be."""
        return int(self._counts.max())


@dataclass
class Survey:
    """Survey of all signals by their names in a `Recording`."""

    signals: dict[str, SignalSurvey] = field(default_factory=dict)
    openings: Openings = field(default_factory=Openings)
    swapped_in_part: bool = False
    """Whether rail and line pressure are `swapped` within samples that were taken together."""

    def take_together(self, signals: Mapping[str, Floats]) -> None:
        """Go on with further samples (n,) of several signals, taken at the same times."""
        part = Survey()
        for name, values in signals.items():
            self.take(name, values)
            part.take(name, values)
        self.swapped_in_part |= swapped(part) is not None

    def take(self, name: str, values: Floats) -> None:
        """Go on with further samples (n,) of a signal."""
        self.signals.setdefault(name, SignalSurvey()).take(values)
        if name == "needle_lift":
            self.openings.take(values)


@dataclass(frozen=True)
class Implausible:
    """A signal that cannot be right."""

    signal: str
    problem: str
    remedy: str

    def error(self, path: Path | None, column: str = "") -> UserError:
        """Error for the user; column: what the signal is called in the file."""
        name = self.signal if column in ("", self.signal) else f"{column} ({self.signal})"
        return UserError(f"{path or 'recording'}, {name}", self.problem, self.remedy)


def refuse_implausible(path: Path | None, survey: Survey, columns: dict[str, str] | None = None) -> None:
    """Raise `UserError` for the first signal that cannot be right. columns: names in the file by signal."""
    for finding in implausible(survey):
        raise finding.error(path, (columns or {}).get(finding.signal, ""))


def implausible(survey: Survey) -> Iterator[Implausible]:
    """Signals of a recording whose ranges are impossible; none where one of the three has no value."""
    rail, line, lift = (survey.signals.get(name) for name in ("rail_pressure", "line_pressure", "needle_lift"))
    if rail is None or line is None or lift is None or not (rail.count and line.count and lift.count):
        return
    for name, pressure in (("rail_pressure", rail), ("line_pressure", line)):
        yield from _exchanged(name, pressure, lift)
    yield from _lift(lift)
    opens = lift.highest > OPEN
    for name, pressure in (("rail_pressure", rail), ("line_pressure", line)):
        yield from _pressure(name, pressure, opens)
    yield from _beside_each_other(rail, line)


def unshut(survey: Survey, zero: float = OPEN) -> Iterator[Implausible]:
    """A lift that moves, and stays above `zero` [m]: a doubt, for the sensor may be off by so much."""
    lift = survey.signals.get("needle_lift")
    if lift is not None and lift.swing > OPEN and lift.lowest > zero:
        yield Implausible(
            "needle_lift",
            f"is never below {lift.lowest / MICROMETRE:.4g} um, as if the needle never shut",
            "check its zero, and scale and offset of its column or signal: of the right bus database?",
        )


def _exchanged(name: str, pressure: SignalSurvey, lift: SignalSurvey) -> Iterator[Implausible]:
    """A pressure that rests near zero and rises as a lift does, beside a lift that is never near zero."""
    opens = pressure.lowest < NEAR_ZERO * pressure.highest and pressure.mean < pressure.highest / 2.0
    if opens and lift.lowest > 2.0 * NEAR_ZERO * lift.highest > 0.0:
        yield Implausible(
            name,
            "rests near zero and opens as a needle's lift does, and needle_lift never is near zero: most likely the "
            "two are exchanged",
            "exchange their columns or signals",
        )


def swapped(survey: Survey) -> tuple[str, str] | None:
    """`SWAPPED` where the rail pressure moves as a line's does and the line's as a rail's."""
    rail, line = survey.signals.get("rail_pressure"), survey.signals.get("line_pressure")
    if rail is None or line is None or not (rail.count and line.count) or line.highest <= line.lowest:
        return None
    margin = FURTHER * line.mean
    is_wider = rail.lowest < line.lowest - margin and rail.highest > line.highest + margin
    return SWAPPED if is_wider else None


def _pressure(name: str, pressure: SignalSurvey, opens: bool) -> Iterator[Implausible]:
    lowest, highest = PRESSURES
    if pressure.mean < -lowest:
        yield Implausible(
            name,
            f"is {pressure.mean / MEGAPASCAL:.4g} MPa in the mean: it is inverted",
            f"give it positive; in [recording.{name}] of a bench file: factor = -1",
        )
        return
    is_low = opens and 0.0 < pressure.highest < lowest
    if pressure.highest <= highest and not is_low:
        return
    likely = [unit for factor, unit in _PRESSURE_FACTORS if lowest <= pressure.highest * factor <= highest]
    yield Implausible(
        name,
        f"reaches {pressure.highest / MEGAPASCAL:.4g} MPa" + (" only, though the needle opens" if is_low else ""),
        f"give pressures of {lowest / MEGAPASCAL:g} to {highest / MEGAPASCAL:g} MPa; check the unit{_likely(likely)}",
    )


def _beside_each_other(rail: SignalSurvey, line: SignalSurvey) -> Iterator[Implausible]:
    """Pressures whose means, which should be about equal, have a ratio of units."""
    if rail.mean <= 0.0 or line.mean <= 0.0:
        return
    ratio = line.mean / rail.mean
    for factor, unit in _PRESSURE_FACTORS:
        if abs(ratio * factor - 1.0) < SAME:
            others = [other for inverse, other in _PRESSURE_FACTORS if abs(inverse * factor - 1.0) < SAME]
            yield Implausible(
                "line_pressure",
                f"is {line.mean / MEGAPASCAL:.4g} MPa in the mean, rail_pressure {rail.mean / MEGAPASCAL:.4g} MPa: "
                f"{ratio:.3g} times as much",
                f"check the units of both; that of line_pressure is likely {unit}"
                + "".join(f", or that of rail_pressure {other}" for other in others),
            )
            return


def _lift(lift: SignalSurvey) -> Iterator[Implausible]:
    highest, lowest = lift.highest, lift.lowest
    if max(highest, -lowest) > LARGEST_LIFT:
        reached = highest if highest > LARGEST_LIFT else lowest
        likely = [unit for factor, unit in _LIFT_FACTORS if OPEN <= abs(reached) * factor <= LARGEST_LIFT]
        yield Implausible(
            "needle_lift",
            f"reaches {reached / MILLIMETRE:.4g} mm",
            f"give lifts below {LARGEST_LIFT / MILLIMETRE:g} mm; check the unit{_likely(likely)}",
        )
    elif lowest < -OPEN and highest < -lowest / 4.0:
        yield Implausible(
            "needle_lift",
            f"goes down to {lowest / MILLIMETRE:.4g} mm and never up: it is inverted",
            "give it positive when the needle opens; in [recording.needle_lift] of a bench file: factor = -1",
        )
    elif highest > OPEN and lift.mean > RESTS_OPEN * highest and lowest < 0.3 * highest:
        yield Implausible(
            "needle_lift",
            f"rests at {lift.mean / MILLIMETRE:.4g} mm and goes down to {lowest / MILLIMETRE:.4g} mm: it is inverted",
            "give 0 for the shut needle; in [recording.needle_lift] of a bench file: factor = -1, and an offset",
        )
    elif 0.0 < highest < SMALLEST_LIFT and highest * lift.count > SHAPE * lift.change > 0.0:
        yield Implausible(
            "needle_lift",
            f"reaches {highest / MILLIMETRE:.4g} mm only",
            f"check the unit{_likely([_LIFT_FACTORS[-1][1]])}",
        )


def _likely(units: list[str]) -> str:
    return f", which is likely {units[0]}" if units else ""
