"""The live rate follows the running injection: a mixture of filters beside x^, by plain formulas and on plants."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.model.model import advance_state, phi_and_rate
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.simulation.schedule import energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.foundation.units import Floats
from observer_rt.model.effects import sized
from observer_rt.model.network import constant_network
from tests.engine.learning.learner_adapter import GOLDEN
from tests.engine.sample_stream import NOMINAL, Stream, stroke
from tests.intervals import Interval
from tests.observed_plants import bench_at, recording_of, with_coloured_noise
from tests.plants.laws import BY_LIFT, NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.worn_lines import on_line

HEALTHY = Faults()
SEAT, FRICTION, STIFFNESS, LAG, OFFSET, DELAY, SLOPE, NOZZLE, NUMBERS = 0, 1, 2, 3, 4, 5, 8, 9, 16  # columns of theta
STEPS = (1e-6, 1e-5, 1e-6, 1e-9, 1e-7, 1e-9, 1.0, 1.0, 1.0, *(1e-6,) * 7)  # of differences
AS_IT_IS, ANY_FLOW, ANOTHER_LINE = (0.01, 0.01, 0.002), (0.3, 0.01, 0.002), (1.0, 0.1)
ON_TIME, LATE = (0.5e-6, 2e-4, 0.2e-6), (35e-6, 2e-4, 30e-6)
EXPLANATIONS = (  # odds; deviations of nozzle and slope at the opening, of their walks in .1 ms, of the other numbers
    (0.9, (0.003, 0.0), (1e-3, 0.0), (*AS_IT_IS, *ON_TIME)),
    (0.02, (0.3, 0.0), (2e-3, 0.0), (*ANY_FLOW, *ON_TIME)),
    (0.02, (0.3, 0.02), (0.015, 0.01), (*ANY_FLOW, *ON_TIME)),
    (0.02, (0.3, 0.0), (0.08, 0.0), (*ANY_FLOW, *ON_TIME)),
    (0.02, (0.003, 0.0), (1e-3, 0.0), (0.01, *ANOTHER_LINE, *ON_TIME)),
    (0.02, (0.003, 0.0), (1e-3, 0.0), (*AS_IT_IS, *LATE)),
    (0.01, (0.3, 0.0), (0.015, 0.0), (0.3, *ANOTHER_LINE, *ON_TIME)),
)


@dataclass
class ReferenceFilter:
    """A Kalman filter on theta, whose nozzle walks on along its slope at every stretch of time."""

    mean: Floats
    covariance: Floats
    log_weight: float


def run_with(stream: Stream, first: int, count: int, theta: Floats) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Innovations of x~ and rates of x^ (count,) after a sample at rest, with theta; and stretches at all samples."""
    constants, rows, memory = stream.observer.constants, stream.rows, stream.observer.memory[0]
    gain, line, opened = stream.observer.gains[-1], constants.coefficients.line, 0
    changed = {name: getattr(line, name) * (1.0 + theta[STIFFNESS]) for name in line.of_stiffness}
    c = constants.coefficients._replace(line=line._replace(**changed, a4=line.a4 * (1.0 + theta[FRICTION])))
    x_tilde, x_hat = rows["x_tilde"][first].copy(), rows["x_hat"][first].copy()
    errors, rates, stretches = np.zeros(count), np.zeros(count), np.zeros(count + 1, np.int64)
    for k, (before, row) in enumerate(pairwise(rows[first : first + 1 + count])):
        earlier = (before["seat_area"] - row["seat_area"]) * theta[DELAY] / 1e-5
        start, end = ((float(each["rail_pressure"]), float(each["seat_area"] + earlier)) for each in (before, row))
        knot = float(before["lift_after"]), float(before["lift_area"] + earlier)
        network = constant_network(theta[NOZZLE + stretches[k]], theta[SEAT])
        pressure = x_tilde[0]
        for x in (x_tilde, x_hat):
            advance_state(x, Interval(start, end, 1e-5, constants.substeps), c, network, knot=knot)
        shown = x_tilde[0] - theta[LAG] / 1e-5 * (x_tilde[0] - pressure)
        errors[k] = row["line_pressure"] - memory["pair"]["offset"] - theta[OFFSET] - shown
        x_tilde[:2] += gain[:2] * errors[k]
        rates[k] = phi_and_rate(x_hat, (end[0], max(end[1], 0.0)), c, network)[1]
        opened += row["seat_area"] > 0.0
        stretches[k + 1] = opened // 10
    return errors, rates, stretches


def reference_rates(stream: Stream, first: int, count: int, spread: float) -> Floats:
    """Live rates and their standard deviations (count, 2) [m3/s] after a sample at rest, by differences."""
    errors, rates, stretches = run_with(stream, first, count, np.zeros(NUMBERS))
    moved = np.array([run_with(stream, first, count, step)[:2] for step in np.diag(STEPS)])
    moved -= np.array([run_with(stream, first, count, -step)[:2] for step in np.diag(STEPS)])
    by_errors, by_rates = (moved / (2.0 * np.array(STEPS))[:, None, None]).transpose(1, 2, 0)
    variance = 1.2 / stream.observer.memory[0]["innovation_noise"]["weight"]
    filters, result = [], []
    for odds, nozzle, _, further in EXPLANATIONS:
        deviations = np.zeros(NUMBERS)
        deviations[:6], deviations[[NOZZLE, SLOPE]] = further, (max(nozzle[0], spread), nozzle[1])
        filters.append(ReferenceFilter(np.zeros(NUMBERS), np.diag(deviations**2), np.log(odds)))
    for k, (error, slopes) in enumerate(zip(errors, by_errors, strict=True)):
        for kalman in filters:
            correct(kalman, error, slopes, variance)
        logs = np.array([kalman.log_weight for kalman in filters])
        weights = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
        mean, by = weights @ np.array([kalman.mean for kalman in filters]), by_rates[k]
        spreads = [by @ kalman.covariance @ by + (by @ (kalman.mean - mean)) ** 2 for kalman in filters]
        total = weights @ spreads if weights[0] <= 0.8 else spreads[0] - (by @ (filters[0].mean - mean)) ** 2
        result.append((max(rates[k] + by @ mean, 0.0), np.hypot(np.sqrt(total), max(0.003, spread) * by[SEAT])))
        if stretches[k + 1] > stretches[k]:
            for kalman, (_, _, walk, _) in zip(filters, EXPLANATIONS, strict=True):
                walk_on(kalman, NOZZLE + stretches[k + 1], (max(walk[0], spread), walk[1]))
    return np.array(result)


def correct(kalman: ReferenceFilter, error: float, slopes: Floats, variance: float) -> None:
    """Correct a filter by an innovation, and move a friction that is too little up to the least one."""
    across, left = kalman.covariance @ slopes, error + float(slopes @ kalman.mean)
    expected = variance + float(slopes @ across)
    kalman.log_weight -= 0.5 * (np.log(expected) + left**2 / expected)
    kalman.mean = kalman.mean - across / expected * left
    kalman.covariance = kalman.covariance - np.outer(across, across) / expected
    below, along = float(kalman.mean[FRICTION]) + 0.05, kalman.covariance[FRICTION]
    if below < 0.0:
        kalman.log_weight -= 0.5 * below**2 / along[FRICTION]
        kalman.mean = kalman.mean - along / along[FRICTION] * below


def walk_on(kalman: ReferenceFilter, newest: int, walk: tuple[float, float]) -> None:
    """Begin another stretch along the slope from the one before."""
    copied = np.eye(NUMBERS)
    copied[newest, [newest - 1, SLOPE, newest]] = 1.0, 1.0, 0.0
    kalman.mean, kalman.covariance = copied @ kalman.mean, copied @ kalman.covariance @ copied.T
    kalman.covariance[[newest, SLOPE], [newest, SLOPE]] += np.square(walk)


@pytest.mark.parametrize("spread", [0.0, 0.012])  # by which flows of late were others than believed
def test_rates_are_those_of_plain_filters(spread: float) -> None:
    schedule, worn = make_schedule([100e6], 1, 0.06, [0.4e-3]), [sized("orifice_area", v_H=0.2)]
    made = simulate(NOMINAL, schedule, 100e3, worn, SimulatedNoise(), seed=4).recording
    end = int(np.flatnonzero(made.needle_lift > 20e-6)[0]) + 250  # the needle does not rest again
    rail, lift, line = made.rail_pressure[:end], made.needle_lift[:end], made.line_pressure[:end]
    stream = Stream(learning=True)
    stream.observer.memory[0]["in_force"]["flow_spread"] = spread
    stream.feed(rail, lift, line)
    first = int(np.flatnonzero(stream.rows["resting"])[-1])
    part = stream.rows[first + 1 : first + 131]
    expected = reference_rates(stream, first, part.size, spread)
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
DRIVE: Points = tuple(map(tuple, np.random.default_rng(3).uniform((40e6, 0.4e-3), (160e6, 1.9e-3), (30, 2)).tolist()))
SHORT_LOW, LONG_HIGH, LONG_LOW, SHORT_HIGH = (60e6, 0.6e-3), (140e6, 1.9e-3), (60e6, 1.9e-3), (140e6, 0.6e-3)


@cache
def live(
    points: Points, laws: Laws = NO_LAWS, faults: Faults = HEALTHY, line: Discrepancy | None = None
) -> tuple[Evaluation, Floats]:
    """A plant's injections at these rail pressures [Pa], for these times [s]; and its true rate (n,) [m3/s]."""
    events = tuple(Event(rail, (Shot(7e-6 * (k % 5), time),), faults) for k, (rail, time) in enumerate(points))
    bench = Bench(Injector(), Needle(), events, seed=5, laws=laws)
    outcome = record(on_line(bench, line, 1) if line else bench)
    observer = bench_at(100e3, GOLDEN / f"{line}.toml" if line else None)
    return evaluate(observer, [recording_of(outcome)]).evaluations[0], outcome.truth.injection_rate


@pytest.mark.parametrize(
    ("line", "laws", "faults"),
    [
        (None, NO_LAWS, Faults(orifice_area=0.3)),
        (None, NO_LAWS, Faults(seat_area=-0.25)),
        (None, Laws(coking=0.1), HEALTHY),
        (None, Laws(rail_and_time=0.1), HEALTHY),
        (None, NO_LAWS, Faults(line_friction=1.0)),
        (Discrepancy.PLAIN, NO_LAWS, Faults(orifice_area=0.2)),
        (Discrepancy.PLAIN, NO_LAWS, Faults(seat_area=-0.25)),
        (Discrepancy.PLAIN, NO_LAWS, Faults(line_friction=1.0)),
        (Discrepancy.PLAIN, NO_LAWS, Faults(line_pressure_sensor_lag=20e-6)),
    ],
)
def test_the_first_injection_is_followed(line: Discrepancy | None, laws: Laws, faults: Faults) -> None:
    """Flows, which in open loop are up to 20 % off, and faults of line and sensor, which are not taken for a flow."""
    for point in (SHORT_LOW, LONG_HIGH):
        evaluation, truth = live((point,), laws, faults, line)
        report = evaluation.reports[0]
        window = slice(report.start_index, report.end_index + 1)
        assert evaluation.trace.injection_rate[window].sum() == pytest.approx(truth[window].sum(), rel=0.025)


def test_coloured_noise_hides_no_change_of_the_flow() -> None:
    """The nozzle passes 30 % more from the fifth injection on."""
    events = tuple(Event(100e6, (Shot(0.0, 1.4e-3),), Faults(orifice_area=0.3 * (k > 3))) for k in range(5))
    outcome = record(Bench(Injector(), Needle(), events, seed=5))
    evaluation = evaluate(bench_at(100e3), [with_coloured_noise(recording_of(outcome), 1)]).evaluations[0]
    window = slice(evaluation.reports[-1].start_index, evaluation.reports[-1].end_index + 1)
    rates = evaluation.trace.injection_rate, evaluation.trace.open_loop_rate, outcome.truth.injection_rate
    by_filters, by_model, true = (rate[window].sum() for rate in rates)
    assert abs(by_filters / true - 1.0) < 0.03 < 0.1 < abs(by_model / true - 1.0)


@pytest.mark.parametrize("late", [-2, 2])
def test_a_needle_that_answers_its_command_sooner_or_later_is_followed(late: int) -> None:
    """By 20 us, which a line pressure beside no lift tells; later it is seen while it stays open, but at no flank."""
    schedule = make_schedule([100e6], 5, 0.06, [1.2e-3])
    made = simulate(NOMINAL, schedule, 100e3, noise=SimulatedNoise())
    commands, true = np.roll(energized(schedule, made.recording.time), -late), made.truth.injection_rate
    recording = made.recording.with_arrays({"energizing": commands}).without_lift()
    trace = evaluate(bench_at(100e3), [recording]).evaluations[0].trace
    edges = np.flatnonzero(np.diff(true > 0.0))
    by_filters, by_model = (
        np.nansum(np.abs(rate - true)[: edges[2]]) for rate in (trace.injection_rate, trace.open_loop_rate)
    )
    assert by_filters < 0.4 * by_model
    opening, end = edges[-2:]
    assert trace.valid[opening + 40 : opening + 90].all()
    assert not trace.valid[np.r_[opening + 2 : opening + 25, end - 15 : end]].any()
    seen = opening + 2 + np.flatnonzero(trace.valid[opening + 2 : end])
    assert np.abs(trace.injection_rate[seen] / true[seen] - 1.0).max() < 0.03


@pytest.mark.parametrize(
    ("laws", "new"),
    [(Laws(rail_and_time=share), (LONG_LOW,) * 2 + (SHORT_HIGH,) * 2) for share in (-0.1, 0.05, 0.1)]
    + [(Laws(nozzle_product=0.2, second_factor=BY_LIFT), (SHORT_HIGH,))]  # whose needle falls sooner
    + [(Laws(rail_and_time=0.1), DRIVE)],  # near known points, too, flows are others than believed, again and again
)
def test_no_rate_is_valid_and_wrong_at_a_new_combination_of_known_points(laws: Laws, new: Points) -> None:
    """A nozzle by the product of two laws, so that no sum of curves holds it."""
    evaluation, truth = live(new if new is DRIVE else (SHORT_LOW, LONG_HIGH) * 3 + new, laws)
    for report in evaluation.reports[6:]:
        window = slice(report.start_index, report.end_index + 1)
        true, trace = truth[window], evaluation.trace
        flows = true > 0.6 * true.max()  # at the flanks a microsecond is more
        wrong = np.abs(trace.injection_rate[window] - true) > 0.03 * true
        assert not np.any(flows & wrong & trace.valid[window])


@pytest.mark.parametrize(
    ("points", "shares"),
    [
        (((50e6, 1.4e-3), (150e6, 1.4e-3)), (1.0, 0.4, 1.0, 1.0)),
        (((100e6, 0.25e-3), (100e6, 1.4e-3)), (1.0, 0.25, 1.0, 1.0)),
    ],
    ids=["another rail pressure", "longer"],
)
def test_a_new_point_is_valid_where_its_rate_is_sharp(points: Points, shares: tuple[float, ...]) -> None:
    """The fifth is unlike the others, and learned from. Masses are by their own pressures."""
    evaluation, truth = live((points[0],) * 4 + (points[1],) * 4 + (points[0],), faults=Faults(orifice_area=0.3))
    for report in evaluation.reports:
        mass = np.trapezoid(truth[report.start_index : report.end_index + 1]) * 1e-5 * report.density
        assert report.valid
        assert report.mass == pytest.approx(mass, rel=0.015)
    for number, expected in zip((3, 4, 5, 7), shares, strict=True):
        start, end = evaluation.reports[number].start_index, evaluation.reports[number].end_index
        flows = start + np.flatnonzero(truth[start:end] > 0.5 * truth[start:end].max())
        seen = flows[evaluation.trace.valid[flows]]
        assert seen.size == pytest.approx(expected * flows.size, abs=0.1 * flows.size)
        assert evaluation.trace.injection_rate[seen] == pytest.approx(truth[seen], rel=0.03)
