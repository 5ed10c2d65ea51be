"""The plants as the observer meets them: a recording, a bench of that sample rate, and its reports."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.files.signals.recording import Recording
from tests.benches import with_signals
from tests.plants import plant
from tests.plants.filters import coloured_noise
from tests.plants.plant import Outcome, record
from tests.plants.windows import true_masses


@dataclass(frozen=True, eq=False)
class ObservedRun:
    """Reports of injections, and their true masses (n,) [kg]."""

    reports: tuple[InjectionReport, ...]
    true: NDArray[np.float64]

    def __getitem__(self, part: slice) -> "ObservedRun":
        return ObservedRun(self.reports[part], self.true[part])

    @property
    def valid(self) -> list[bool]:
        return [report.valid for report in self.reports]

    @property
    def errors(self) -> NDArray[np.float64]:
        return np.array([report.mass for report in self.reports]) / self.true - 1.0

    @property
    def error(self) -> float:
        return float(sum(report.mass for report in self.reports) / self.true.sum() - 1.0)

    @property
    def inside(self) -> list[bool]:
        """Of the valid masses, whether they lie in their intervals."""
        pairs = zip(self.reports, self.true, strict=True)
        return [r.mass_ci95[0] <= true <= r.mass_ci95[1] for r, true in pairs if r.valid and r.mass_ci95]


def observed(bench: plant.Bench, observer: Bench | None = None) -> ObservedRun:
    """What the observer of a bench, by default the example's, says of the injections of a plant."""
    outcome = record(bench)
    reports = evaluate(observer or bench_at(bench.sample_rate), [recording_of(outcome)]).evaluations[0].reports
    return ObservedRun(reports, true_masses(outcome, bench))


def recording_of(outcome: Outcome) -> Recording:
    """What the observer is given: no truth."""
    m = outcome.measured
    return Recording(m.time, m.rail_pressure, m.needle_lift, m.line_pressure)


def commanded(
    bench: plant.Bench, outcome: Outcome, opens: float, shuts: float, jitter: float = 0.0, late: float = 0.0
) -> Recording:
    """A recording with commands, that opened the needle and shut it again so long after [s]."""
    rng, time = np.random.default_rng([bench.seed, 5]), outcome.measured.time - late
    level = np.zeros(time.size)
    for event, start in zip(bench.events, bench.starts, strict=False):
        for opening, _, closing, *_ in plant.strokes_of(event, start, bench.needle, bench.injector.max_lift):
            on, off = rng.normal((opening - opens, closing - shuts), jitter)
            level[time >= on], level[time >= off] = 1.0, 0.0
    return replace(recording_of(outcome), energizing=level)


def with_coloured_noise(recording: Recording, seed: int) -> Recording:
    """The same with noise of .1 MPa in its line pressure, as a low pass of 4 kHz leaves it."""
    white, rate = np.random.default_rng(seed).normal(0.0, 0.1e6, recording.samples), recording.sample_rate
    return replace(recording, line_pressure=recording.line_pressure + coloured_noise(white, 1.0 / rate, 4e3))


def bench_at(sample_rate: float, model: Path | None = None, accuracy_percent: float = 0.0) -> Bench:
    """The example bench at a sample rate [Hz], with another injector file, and pressure sensors, than its own."""
    accuracy = {"accuracy_percent": accuracy_percent}
    bench = with_signals(load_bench(model=model).exact, {"rail_pressure": accuracy, "line_pressure": accuracy})
    return bench.with_sections(sampling=SamplingConfig(rate_hz=sample_rate))
