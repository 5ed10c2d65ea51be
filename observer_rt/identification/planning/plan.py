"""The next measurement: operating points ranked by how surely they would decide between rivals, as a schedule."""

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.documents import DocumentPart, Number
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.planning.separation import KnownRecordings, MeasuredQuantity, Prospect, Rival
from observer_rt.model.effective import EffectiveModel

PRESSURE_STEP = 20 * MEGAPASCAL
BELOW, ABOVE = 0.5, 1.5  # of the lowest and the highest rail pressure recorded, between which points lie
LOWEST_PRESSURE, HIGHEST_PRESSURE = 20 * MEGAPASCAL, 200 * MEGAPASCAL
ENERGIZING = (0.4e-3, 0.8e-3, 1.9e-3)  # s
PAUSES = (2e-3, 60e-3)  # s between injections: into the ringing of the one before, and after it
INJECTIONS = 10  # at an operating point
DECIDED = 0.95  # expected confidence from which on a cheaper measurement is preferred to a surer one
SHOWN = 5  # of the ranking, and steps of the schedule

SimulateInjections = Callable[[EffectiveModel, float, float, float, float], Recording]
"""A recording without noise: of a model, at a rail pressure [Pa], energizing time and pause [s], sample rate [Hz]."""
Confidence = Callable[[Iterable[float]], float]
"""Probability of an explanation, others being behind it by these amounts of -2 log L."""


@dataclass(frozen=True)
class PlannedPoint:
    """An operating point: rail pressure [Pa], energizing time, pause between injections [s]."""

    rail_pressure: float
    energizing: float
    pause: float


class PlannedMeasurement(DocumentPart):
    """A measurement. separation: -2 log L by which the two rivals nearest to each other are expected to differ;
    confidence: expected afterwards; masses_mg: of an injection, as each rival has it."""

    rail_pressure_MPa: float  # noqa: N815 - units as printed
    energizing_ms: float
    pause_ms: float
    injections: int
    measure: MeasuredQuantity
    separation: Number
    confidence: float
    masses_mg: tuple[float, ...]


class MeasurementPlan(DocumentPart):
    """What to measure next. rivals: explanations that are left, the leading one first; confidence: in that now;
    measurements: the best first."""

    rivals: tuple[str, ...]
    confidence: float
    measurements: tuple[PlannedMeasurement, ...]


def points_for(measured: Sequence[Measurement]) -> list[PlannedPoint]:
    """Operating points to choose from, about the rail pressures that were recorded."""
    recorded = [one.rail_pressure for one in measured]
    lowest = max(LOWEST_PRESSURE, BELOW * min(recorded))
    highest = min(HIGHEST_PRESSURE, ABOVE * max(recorded))
    steps = range(math.ceil(lowest / PRESSURE_STEP), math.floor(highest / PRESSURE_STEP) + 1)
    return [
        PlannedPoint(step * PRESSURE_STEP, energizing, pause)
        for step, energizing, pause in product(steps, ENERGIZING, PAUSES)
    ]


@dataclass(frozen=True, eq=False)
class Planner:
    """Judges operating points by what tells rivals apart.

    nominal: the model they depart from; data: the recordings so far; confidence: as in the verdict.
    """

    rivals: Sequence[Rival]
    nominal: EffectiveModel
    data: KnownRecordings
    simulate: SimulateInjections
    confidence: Confidence

    def plan(
        self, points: Sequence[PlannedPoint], workers: int, progress: Callable[[float], None]
    ) -> MeasurementPlan:
        """The ranking of these points: the best of each rail pressure, at most SHOWN of them."""
        measurements: list[PlannedMeasurement] = []
        with ThreadPoolExecutor(workers) as pool:
            for number, those in enumerate(pool.map(self._at, points), 1):
                measurements += those
                progress(number / len(points))
        return MeasurementPlan(
            rivals=tuple(rival.words for rival in self.rivals),
            confidence=self.confidence(rival.behind for rival in self.rivals[1:]),
            measurements=tuple(_chosen(measurements)),
        )

    def _at(self, point: PlannedPoint) -> list[PlannedMeasurement]:
        """Measurements at a point; none where an injection of it cannot be judged."""
        try:
            prospects = [self._prospect(rival, point) for rival in self.rivals]
        except (UserError, ArithmeticError):
            return []
        return [self._measurement(point, prospects, what) for what in MeasuredQuantity]

    def _prospect(self, rival: Rival, point: PlannedPoint) -> Prospect:
        truth = rival.model(rival.theta)
        rate = self.data.measured.recording.sample_rate
        as_recorded = self.data.measured.as_recorded(truth)
        made = self.simulate(as_recorded, point.rail_pressure, point.energizing, point.pause, rate)
        return Prospect(made, truth, self.nominal, self.data)

    def _measurement(
        self, point: PlannedPoint, prospects: Sequence[Prospect], what: MeasuredQuantity
    ) -> PlannedMeasurement:
        """The expected result of a measurement: each rival may be right, as probably as it is now."""
        rivals, count = self.rivals, len(self.rivals)
        separations = np.full((count, count), np.inf)
        for i, j in product(range(count), repeat=2):
            if i != j:
                separations[i, j] = prospects[i].separation(rivals[j], self.data.roots[j], what, INJECTIONS)
        after = [
            self.confidence(
                rivals[j].behind - truth.behind + separations[i, j] for j in range(count) if j != i
            )
            for i, truth in enumerate(rivals)
        ]
        odds = [self.confidence(()) / self.confidence((rival.behind,)) - 1.0 for rival in rivals]
        return PlannedMeasurement(
            rail_pressure_MPa=point.rail_pressure / MEGAPASCAL,
            energizing_ms=point.energizing / MILLISECOND,
            pause_ms=point.pause / MILLISECOND,
            injections=INJECTIONS,
            measure=what,
            separation=float(np.min(separations)),
            confidence=float(np.average(after, weights=odds)),
            masses_mg=tuple(one.mass / MILLIGRAM for one in prospects),
        )


def _chosen(measurements: Sequence[PlannedMeasurement]) -> Iterator[PlannedMeasurement]:
    """The best, each rail pressure once: the cheapest that decide; else those that decide most surely."""
    cost = list(MeasuredQuantity)

    def rank(candidate: PlannedMeasurement) -> tuple[float, int, float]:
        return (
            -min(candidate.confidence, DECIDED),
            cost.index(candidate.measure),
            -(candidate.separation or 0.0),
        )

    seen: set[float] = set()
    for planned in sorted(measurements, key=rank):
        if planned.rail_pressure_MPa not in seen and len(seen) < SHOWN:
            seen.add(planned.rail_pressure_MPa)
            yield planned


def write_schedule(path: Path, plan: MeasurementPlan) -> None:
    """Write the plan as CSV that a bench can run, a step a line, units in the header."""
    header = ("step", "rail_pressure_MPa", "energizing_ms", "pause_ms", "injections", "measure")
    with file_errors(path), replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(header)
        for step, measurement in enumerate(plan.measurements, 1):
            table.writerow(
                [
                    step,
                    *(f"{getattr(measurement, name):g}" for name in header[1:5]),
                    measurement.measure.value,
                ]
            )
