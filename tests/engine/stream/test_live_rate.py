"""The live rate follows the running injection: a mixture of filters beside x^, by plain formulas and on plants."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.model.model import advance_state, phi_and_rate
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.schedule import energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import sized
from observer_rt.model.network import constant_network
from tests.engine.sample_stream import NOISE, NOMINAL, Stream, stroke
from tests.intervals import Interval
from tests.observed_plants import bench_at, recording_of
from tests.plants.laws import BY_LIFT, NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record

Numbers = NDArray[np.float64]
HEALTHY = Faults()
ODDS = (0.98, 0.01, 0.01)
AT_OPENING = ((0.003, 0.01), (0.3, 0.3), (0.3, 0.3))  # standard deviations of r and s
WALKS = ((3e-4, 1e-3), (2e-3, 5e-3), (2e-2, 2e-2))  # in 10 us


@dataclass
class ReferenceFilter:
    """A Kalman filter on z = [p_L, Q_L, p_S, r, s]."""

    mean: Numbers
    covariance: Numbers
    log_weight: float


def reference_rates(stream: Stream, first: int, count: int) -> Numbers:
    """Live rates and their standard deviations (count, 2) [m3/s] after a sample at rest, by differences."""
    constants, rows, memory = stream.observer.constants, stream.rows, stream.observer.memory[0]
    c, gain = constants.coefficients, stream.observer.gains[-1, 0]
    variance = (1.0 - gain) / memory["innovation_noise"]["weight"]
    of_flow = (c.line.a3 * 1e-5 * NOISE.rail_pressure / c.pressure_scale) ** 2
    filters = []
    for odds, widths in zip(ODDS, AT_OPENING, strict=True):
        at_rest = (gain * variance, gain * variance * c.line.a3 / c.line.a1, 0.0)
        z = np.append(rows["x_hat"][first], [0.0, 0.0])
        filters.append(ReferenceFilter(z, np.diag([*at_rest, *np.square(widths)]), np.log(odds)))
    result = []
    for before, row in pairwise(rows[first : first + 1 + count]):
        start, end = ((float(sample["rail_pressure"]), float(sample["seat_area"])) for sample in (before, row))
        knot = float(before["lift_after"]), float(before["lift_area"])
        step = Step(Interval(start, end, 1e-5, constants.substeps), knot, c)
        mean, _ = mixed(filters)
        change, predicted = slopes(step.after, mean), step.after(mean)
        is_open = max(before["seat_area"], row["seat_area"]) > 0.0
        for kalman, walks in zip(filters, WALKS, strict=True):
            widened = kalman.covariance + is_open * np.diag([0.0, 0.0, 0.0, *np.square(walks)])
            kalman.mean = predicted + change @ (kalman.mean - mean)
            kalman.covariance = change @ widened @ change.T
            error = row["line_pressure"] - memory["pair"]["offset"] - kalman.mean[0]
            across, expected = kalman.covariance[:, 0].copy(), kalman.covariance[0, 0] + variance
            kalman.mean = kalman.mean + across / expected * error
            kalman.covariance = kalman.covariance - np.outer(across, across) / expected
            kalman.covariance[1, 1] += of_flow
            kalman.log_weight -= 0.5 * (np.log(expected) + error**2 / expected)
        mean, weights = mixed(filters)
        by = slopes(step.rate, mean)[0]
        spreads = [by @ kalman.covariance @ by + (by @ (kalman.mean - mean)) ** 2 for kalman in filters]
        result.append((step.rate(mean)[0], np.sqrt(weights @ spreads)))
    return np.array(result)


class Step(NamedTuple):
    """From a sample to the next, where the area may bend at a knot."""

    interval: Interval
    knot: tuple[float, float]
    c: Coefficients

    def after(self, z: Numbers) -> Numbers:
        x = z[:3].copy()
        advance_state(x, self.interval, self.c, constant_network(z[3], z[4]), knot=self.knot)
        return np.append(x, z[3:])

    def rate(self, z: Numbers) -> Numbers:
        """At its end (1,) [m3/s]."""
        rail, area = self.interval.end
        return np.array([phi_and_rate(z[:3], (rail, max(area, 0.0)), self.c, constant_network(z[3], z[4]))[1]])


def mixed(filters: list[ReferenceFilter]) -> tuple[Numbers, Numbers]:
    """Mean of all filters, and their weights."""
    logs = np.array([kalman.log_weight for kalman in filters])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    return weights @ np.array([kalman.mean for kalman in filters]), weights


def slopes(function: Callable[[Numbers], Numbers], z: Numbers) -> Numbers:
    """Derivatives by differences."""
    steps = 1e-6 * np.eye(z.size)
    return np.array([(function(z + step) - function(z - step)) / 2e-6 for step in steps]).T


def test_rates_are_those_of_plain_filters() -> None:
    schedule, worn = make_schedule([100e6], 1, 0.06, [0.8e-3]), [sized("orifice_area", v_H=0.2)]
    made = simulate(NOMINAL, schedule, 100e3, worn, SimulatedNoise(), seed=4).recording
    end = int(np.flatnonzero(made.needle_lift > 20e-6)[0]) + 250  # the needle does not rest again
    rail, lift, line = made.rail_pressure[:end], made.needle_lift[:end], made.line_pressure[:end]
    stream = Stream(learning=True).feed(rail, lift, line)
    first = int(np.flatnonzero(stream.rows["resting"])[-1])
    part = stream.rows[first + 1 : first + 131]
    expected = reference_rates(stream, first, part.size)
    assert part["injection_rate"].max() > 1.1 * part["open_loop_rate"].max()
    np.testing.assert_allclose(part["injection_rate"], expected[:, 0], atol=1e-3 * expected[:, 0].max())
    np.testing.assert_allclose(part["rate_sigma"], expected[:, 1], rtol=0.02, atol=1e-3 * expected[:, 0].max())


@pytest.mark.parametrize(("open_for", "known_until"), [(50, 32), (100, 100), (200, 120)])
def test_the_flow_is_known_where_openings_have_shown_it(open_for: int, known_until: int) -> None:
    """A needle that falls sooner than in any of them shows something new, as one that is open for longer."""
    stream = Stream(events_required=0)
    carried = stream.observer.memory[0]["in_force"]
    carried["known_from"], carried["known_until"] = 0.6e-3, 1.2e-3
    stream.stay_shut(20e-3).move(stroke(open_for)).stay_shut(5e-3)
    opening = int(np.flatnonzero(stream.rows["seat_area"] > 0.0)[0])
    is_valid = np.append(stream.rows["valid"][opening : opening + open_for], 0)
    assert int(is_valid.argmin()) == pytest.approx(known_until, abs=3)


Points = tuple[tuple[float, float], ...]
SHORT_LOW, LONG_HIGH, LONG_LOW, SHORT_HIGH = (60e6, 0.6e-3), (140e6, 1.9e-3), (60e6, 1.9e-3), (140e6, 0.6e-3)


@cache
def live(points: Points, laws: Laws = NO_LAWS, faults: Faults = HEALTHY) -> tuple[Evaluation, Numbers]:
    """A plant's injections at these rail pressures [Pa], for these times [s]; and its true rate (n,) [m3/s]."""
    events = tuple(Event(rail, (Shot(7e-6 * (k % 5), time),), faults) for k, (rail, time) in enumerate(points))
    outcome = record(Bench(Injector(), Needle(), events, seed=5, laws=laws))
    evaluation = evaluate(bench_at(100e3), [recording_of(outcome)]).evaluations[0]
    return evaluation, outcome.truth.injection_rate


@pytest.mark.parametrize(
    ("laws", "faults"),
    [
        (NO_LAWS, Faults(orifice_area=0.3)),
        (NO_LAWS, Faults(seat_area=-0.25)),
        (Laws(coking=0.1), Faults()),
        (Laws(rail_and_time=0.1), Faults()),
    ],
    ids=["nozzle", "seat", "coking", "rail and time"],
)
def test_the_first_injection_is_followed(laws: Laws, faults: Faults) -> None:
    for point in (SHORT_LOW, LONG_HIGH):
        evaluation, truth = live((point,), laws, faults)
        report, trace = evaluation.reports[0], evaluation.trace
        window = slice(report.start_index, report.end_index + 1)
        rates = truth, trace.injection_rate, trace.open_loop_rate
        true, by_filters, by_model = (rate[window].sum() for rate in rates)
        assert abs(by_filters / true - 1.0) < 0.025
        assert abs(by_filters / true - 1.0) < abs(by_model / true - 1.0)


@pytest.mark.parametrize("late", [-2, 2])
def test_a_needle_that_answers_its_command_sooner_or_later_is_followed(late: int) -> None:
    """By 20 us, which a line pressure beside no lift tells."""
    schedule = make_schedule([100e6], 1, 0.06, [1.2e-3])
    made = simulate(NOMINAL, schedule, 100e3, noise=SimulatedNoise())
    commands = np.roll(energized(schedule, made.recording.time), -late)
    recording = made.recording.with_arrays({"energizing": commands}).without_lift()
    trace = evaluate(bench_at(100e3), [recording]).evaluations[0].trace
    rates = trace.injection_rate, trace.open_loop_rate
    by_filters, by_model = (np.nansum(np.abs(rate - made.truth.injection_rate)) for rate in rates)
    assert by_filters < 0.4 * by_model


@pytest.mark.parametrize(
    ("laws", "new"),
    [(Laws(rail_and_time=share), (LONG_LOW,) * 2 + (SHORT_HIGH,) * 2) for share in (-0.1, 0.05, 0.1)]
    + [(Laws(nozzle_product=0.2, second_factor=BY_LIFT), (SHORT_HIGH,))],  # whose needle falls sooner
)
def test_no_rate_is_valid_and_wrong_at_a_new_combination_of_known_points(laws: Laws, new: Points) -> None:
    """A nozzle by the product of two laws, so that no sum of curves holds it."""
    evaluation, truth = live((SHORT_LOW, LONG_HIGH) * 3 + new, laws)
    for report in evaluation.reports[6:]:
        window = slice(report.start_index, report.end_index + 1)
        true, trace = truth[window], evaluation.trace
        flows = true > 0.6 * true.max()  # at the flanks a microsecond is more
        wrong = np.abs(trace.injection_rate[window] - true) > 0.03 * true
        assert not np.any(flows & wrong & trace.valid[window])


@pytest.mark.parametrize(
    ("points", "shares"),
    [
        (((50e6, 1.4e-3),) * 4 + ((150e6, 1.4e-3),) * 4, (0.9, 0.0, 0.9)),
        (((100e6, 0.25e-3),) * 4 + ((100e6, 1.4e-3),) * 4, (1.0, 0.15, 0.9)),
    ],
    ids=["another rail pressure", "longer"],
)
def test_a_rate_unlike_those_learned_from_is_not_valid(points: Points, shares: tuple[float, ...]) -> None:
    """The fifth is; the next is learned from and the last is valid. Masses are by their own pressures."""
    evaluation, truth = live((*points, points[0]), faults=Faults(orifice_area=0.3))
    assert all(report.valid for report in evaluation.reports)
    for report in evaluation.reports:
        mass = np.trapezoid(truth[report.start_index : report.end_index + 1]) * 1e-5 * report.density
        assert report.mass == pytest.approx(mass, rel=0.015)
    after = evaluation.reports[5]
    assert evaluation.trace.valid[after.start_index : after.end_index + 1].all()
    for number, expected in zip((3, 4, 7), shares, strict=True):
        report = evaluation.reports[number]
        window = slice(report.start_index, report.end_index + 1)
        flows = truth[window] > 0.05 * truth[window].max()
        assert np.mean(evaluation.trace.valid[window][flows]) == pytest.approx(expected, abs=0.15)
