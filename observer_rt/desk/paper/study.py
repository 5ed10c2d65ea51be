"""The runs behind the paper's Figs. 3-5: its scheme as published, and ours, on the same simulated injections."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from observer_rt.config.bench import Bench
from observer_rt.core.model.laws import normalised_area
from observer_rt.core.model.model import phi_and_rate
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.paper import scheme
from observer_rt.desk.paper.table import Estimator, EstimatorCurves, Study, WearCase
from observer_rt.desk.simulation.plant import Truth
from observer_rt.desk.simulation.schedule import FIRST_EVENT, make_schedule
from observer_rt.desk.simulation.simulate import Simulation, simulate
from observer_rt.engine.estimation.predictor import SETTLE, Window
from observer_rt.engine.observer import LEARNING_LEAD, WINDOW_LEAD, WINDOW_TAIL, Durations
from observer_rt.engine.service.injector import bench_constants
from observer_rt.files.replay.framing import bench_for
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND, Floats
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import sized
from observer_rt.model.network import constant_network

SHUT = 1 * MICROMETRE  # lift up to which the needle counts as shut
RAIL_PRESSURES = tuple(p * MEGAPASCAL for p in (60.0, 100.0, 140.0))  # Pa, of Fig. 3
RAIL_PRESSURE = 100 * MEGAPASCAL  # of Figs. 4 and 5
ENERGIZING_TIME = 1.9 * MILLISECOND
NOZZLE_WEAR = 0.3  # v_H of Fig. 4
SWEEP = tuple(round(-0.5 + 0.1 * i, 1) for i in range(11))  # v_H of Fig. 5
TRAININGS = 10  # of the curves named "trained on"
PERIOD = 40 * MILLISECOND  # from event to event, long enough for a training to take force before the next
SAMPLE_RATE = 100e3  # Hz
LARGEST_GAIN = 1e5  # 1/s, of the paper's identification system; at most the sample rate, above the line's mode
Progress = Callable[[float], None]


class InjectionWindow(NamedTuple):
    """Samples [first, last) over which an injection is scored, and those at which the needle opens and shuts."""

    first: int
    last: int
    opening: int
    shut: int

    @property
    def span(self) -> slice:
        """The samples as a slice."""
        return slice(self.first, self.last)


def injection_windows(needle_lift: Floats, sample_rate: float) -> list[InjectionWindow]:
    """Windows of all strokes in a noise-free lift [m] (n,): 0.15 ms before opening to 0.5 ms after shutting."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], needle_lift > SHUT, [False]])))
    lead, tail = round(WINDOW_LEAD * sample_rate), round(WINDOW_TAIL * sample_rate)
    return [
        InjectionWindow(int(opening) - lead, int(shut) + tail + 1, int(opening), int(shut))
        for opening, shut in zip(edges[::2], edges[1::2], strict=True)
    ]


def true_states(truth: Truth, c: Coefficients) -> Floats:
    """True states x of (24), (n, 3), normalised."""
    return np.column_stack(
        [
            (truth.line_pressure - c.chamber_pressure) / c.pressure_scale,
            truth.line_flow / c.flow_scale,
            (truth.sac_pressure - c.chamber_pressure) / c.pressure_scale,
        ]
    )


def inputs(truth: Truth, c: Coefficients) -> Floats:
    """Inputs u of (24), (n, 2), normalised."""
    area = [normalised_area(lift, c.seat) for lift in truth.needle_lift]
    return np.column_stack([(truth.rail_pressure - c.chamber_pressure) / c.pressure_scale, np.array(area)])


def true_fault(x: Floats, u: Floats, c: Coefficients, wear: float) -> Floats:
    """True phi of (27), (n, 3) [1/s], for a nozzle wear v_H and v_S = 0, along x (n, 3) and u (n, 2)."""
    network = constant_network(nozzle=wear)
    return np.array([phi_and_rate(row, col, c, network)[0] for row, col in zip(x, u, strict=True)])


def learning_window(truth: Truth, injection: InjectionWindow, c: Coefficients, rate: float) -> tuple[Window, int]:
    """The event round one injection for the paper's pair, and its first sample, at a rate [Hz].

    From 1 ms before the opening to the end of the event gap; y = x_1 without noise, the line at its true state.
    """
    first = injection.opening - round(LEARNING_LEAD * rate)
    last = injection.shut + round(Durations().event_gap * rate)
    samples = np.arange(first, last)
    x, u = true_states(truth, c)[first:last], inputs(truth, c)[first:last]
    settled = injection.shut + round(SETTLE * rate)
    window = Window(
        inputs=u,
        output=x[:, 0].copy(),
        resting=(samples < injection.opening) | (samples > settled),
        start=np.array([x[0, 0], x[0, 1], 0.0, x[0, 0]]),
        opening=injection.opening - first,
    )
    return window, first


def run_study(bench: Bench, progress: Progress) -> Study:
    """Simulate, train and evaluate all cases; `progress` is called with the share done, 0 to 1."""
    c = bench.injector.coefficients
    healthy = []
    for pressure in RAIL_PRESSURES:
        schedule = make_schedule([pressure], 1, PERIOD, [ENERGIZING_TIME])
        healthy.append(simulate(bench.injector.parameters, schedule, SAMPLE_RATE).truth)
    cases = []
    for number, wear in enumerate(SWEEP):
        cases.append(_wear_case(bench, wear))
        progress((number + 1) / len(SWEEP))
    return Study(c, tuple(healthy), tuple(cases))


def _simulated(bench: Bench, wear: float, events: int) -> Simulation:
    schedule = make_schedule([RAIL_PRESSURE], events, PERIOD, [ENERGIZING_TIME])
    return simulate(bench.injector.parameters, schedule, SAMPLE_RATE, (sized("orifice_area", v_H=wear),))


def _wear_case(bench: Bench, wear: float) -> WearCase:
    c = bench.injector.coefficients
    single = _simulated(bench, wear, 1)
    several = _simulated(bench, wear, TRAININGS)
    (injection,) = injection_windows(single.truth.needle_lift, SAMPLE_RATE)
    span = injection.span
    by_paper = _Scheme(bench, single, injection)
    x, u = true_states(single.truth, c)[span], inputs(single.truth, c)[span]
    return WearCase(
        nozzle_wear=wear,
        time=single.truth.time[span] - FIRST_EVENT,
        truth=EstimatorCurves(x[:, 2], true_fault(x, u, c, wear), single.truth.injection_rate[span]),
        estimates={
            Estimator.MODEL: by_paper.estimate(by_paper.trained(0)),
            Estimator.PAPER: by_paper.estimate(by_paper.trained(1)),
            Estimator.PAPER_TRAINED_ON: by_paper.estimate(by_paper.trained(TRAININGS)),
            Estimator.OURS: _ours(bench, single, single, injection),
            Estimator.OURS_TRAINED_ON: _ours(bench, several, single, injection),
        },
    )


def _ours(bench: Bench, learned_from: Simulation, seen: Simulation, injection: InjectionWindow) -> EstimatorCurves:
    """Our curves for an injection of `seen`, after learning from another recording, or the same."""
    knowledge = evaluate(bench, [learned_from.recording]).knowledge
    (evaluation,) = evaluate(bench, [seen.recording], knowledge, learning=False).evaluations
    trace, span = evaluation.trace, injection.span
    return EstimatorCurves(trace.x[span, 2], trace.phi[span], trace.open_loop_rate[span])


class _Scheme:
    """The paper's scheme on one noise-free injection, on which it is trained and then evaluated."""

    def __init__(self, bench: Bench, simulation: Simulation, injection: InjectionWindow) -> None:
        constants = bench_constants(bench_for(bench, simulation.recording).injector)
        c = constants.coefficients
        self._setting = scheme.PaperSetting(constants.interval, constants.substeps, c, LARGEST_GAIN)
        self._window, start = learning_window(simulation.truth, injection, c, simulation.recording.sample_rate)
        self._span = slice(injection.first - start, injection.last - start)

    def trained(self, trainings: int) -> scheme.FreeNetwork:
        """The network after a number of trainings; every result takes force, good or bad. 0 trainings: phi = 0."""
        in_force, start = scheme.no_fault(), scheme.scaled_identity(scheme.BETA)
        for _ in range(trainings):
            in_force = start = scheme.train(self._window, self._setting, in_force, start)
        return scheme.free_network(in_force, self._setting.gain)

    def estimate(self, network: scheme.FreeNetwork) -> EstimatorCurves:
        """The observer with this network over the injection."""
        seen = scheme.swept(self._window, self._setting, network)
        return EstimatorCurves(seen.x[self._span, 2], seen.phi[self._span], seen.rate[self._span])
