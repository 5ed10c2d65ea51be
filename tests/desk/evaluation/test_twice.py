"""Injections looked at twice, against the truth of simulated worn injectors and against one look."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import Evaluation, evaluate
from observer_rt.desk.evaluation.twice import SecondLook
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import effective_model, sized

BENCH = load_bench()
C: Coefficients = effective_model(BENCH.injector.parameters).coefficients


@cache
def made(v_h: float, injections: int = 6, seed: int = 11, v_s: float = -0.15) -> Simulation:
    """Injections at three pressures and two durations, with a measured rate."""
    schedule = make_schedule([60e6, 100e6, 140e6], injections, 0.05, [1.9e-3, 1.0e-3])
    worn = (sized("orifice_area", v_H=v_h), sized("seat_area", v_S=v_s))
    return simulate(BENCH.injector.parameters, schedule, 100e3, worn, SimulatedNoise(), True, seed)


@cache
def looked(twice: bool, v_h: float = 0.25) -> Evaluation:
    return evaluated(made(v_h).recording, twice)


def evaluated(recording: Recording, twice: bool) -> Evaluation:
    return history([recording], twice)[0]


def history(recordings: Sequence[Recording], twice: bool) -> Sequence[Evaluation]:
    look = SecondLook()
    result = evaluate(BENCH, recordings, learner_of=look.learner, curves_of=C)
    if twice:
        look.revise(result.evaluations)
    return result.evaluations


def true_mass(simulation: Simulation, start: int, end: int) -> float:
    rate = simulation.truth.injection_rate[start : end + 1]
    return float(np.trapezoid(rate)) / 100e3 * C.density


def test_the_first_injections_are_as_good_as_the_last() -> None:
    once, again = looked(False).reports, looked(True).reports
    assert not once[0].valid
    assert all(report.valid for report in again)
    for report in again:
        true = true_mass(made(0.25), report.start_index, report.end_index)
        assert report.mass == pytest.approx(true, rel=4e-3)
        assert report.mass_ci95 is not None
        low, high = report.mass_ci95
        assert low <= true <= high
        assert high - low < 0.014 * true
    assert abs(once[0].mass - again[0].mass) > 0.1 * again[0].mass


def test_curves_trace_and_errors_are_those_of_the_second_look() -> None:
    once, again = looked(False), looked(True)
    for position, (before, after) in enumerate(zip(once.injections, again.injections, strict=True)):
        window = slice(after.report.start_index, after.report.end_index + 1)
        curves = again.curves[position]
        np.testing.assert_array_equal(again.trace.injection_rate[window], curves.estimated)
        np.testing.assert_array_equal(again.trace.injection_rate_sigma[window], curves.sigma)
        assert again.trace.valid[window].all()
        assert curves.reference is not None
        error = np.sqrt(np.mean((curves.estimated - curves.reference) ** 2))
        assert after.rate_rmse == pytest.approx(error)
        assert after.nominal_mass == before.nominal_mass
        assert after.measured_mass == before.measured_mass
    assert again.injections[0].rate_rmse < 0.5 * once.injections[0].rate_rmse
    shut = np.ones(again.trace.valid.size, bool)
    for report in again.reports:
        shut[report.start_index : report.end_index + 1] = False
    np.testing.assert_array_equal(again.trace.injection_rate[shut], once.trace.injection_rate[shut])


def test_wear_of_the_first_is_that_of_the_last() -> None:
    """A healthy injector, and one whose nozzle is worn from the first injection on: that one is a sudden change."""
    recordings = [made(v_h, seed=seed, v_s=0.0).recording for v_h, seed in ((0.0, 3), (0.1, 5))]
    once, again = (history(recordings, twice)[1].reports[1:] for twice in (False, True))
    for effect in (NOZZLE, SEAT):
        last = again[-1].indicators[effect].value
        for report in again:
            interval = report.indicators[effect].ci95
            assert interval is not None
            assert interval[0] <= last <= interval[1]
    assert farthest(again, SEAT, again[-1]) < 0.003  # its sigma is .01
    assert farthest(again, NOZZLE, again[-1]) < 0.7 * farthest(once, NOZZLE, once[-1])
    wide, narrow = (reports[0].indicators[NOZZLE].sigma for reports in (once, again))
    assert wide is not None
    assert narrow is not None
    assert narrow < 0.8 * wide


def farthest(reports: Sequence[InjectionReport], effect: str, last: InjectionReport) -> float:
    """Largest distance of a wear from that of the last injection."""
    return max(abs(report.indicators[effect].value - last.indicators[effect].value) for report in reports)


def test_one_event_alone_stays_as_it_was() -> None:
    recording = made(0.25, injections=1).recording
    once, again = (evaluated(recording, twice).reports for twice in (False, True))
    assert [report.reason for report in again] == [Reason.TOO_FEW_EVENTS]
    assert again[0].mass == once[0].mass


def test_what_is_contradicted_stays_refused() -> None:
    """A line pressure that is another injector's for one event in the middle."""
    recording = made(0.25).recording
    line = recording.line_pressure.copy()
    odd_one = slice(round(0.29 * 100e3), round(0.33 * 100e3))
    line[odd_one] = made(-0.3).recording.line_pressure[odd_one]
    odd = evaluated(recording.with_arrays({"line_pressure": line}), twice=True).reports
    once = evaluated(recording.with_arrays({"line_pressure": line}), twice=False).reports
    assert not once[3].valid
    assert not odd[3].valid
    assert odd[3].reasons == once[3].reasons
    assert odd[0].valid
    for report in (odd[0], odd[1]):
        true = true_mass(made(0.25), report.start_index, report.end_index)
        assert report.mass == pytest.approx(true, rel=0.01)
