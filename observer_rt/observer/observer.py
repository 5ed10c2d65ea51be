"""Making an observer, handing over its events, putting what was learned into force."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.learned import learned_of
from observer_rt.estimation.predictor import Window
from observer_rt.foundation.continuity import Break
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.coefficients import averaged
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.model.network import zero_network
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.sensor import sensor_of
from observer_rt.model.stability import substeps_needed
from observer_rt.observer.learning.doubts.adequacy import Innovations, Objection
from observer_rt.observer.learning.healthy import NOT_FITTED, Healthy
from observer_rt.observer.learning.knowledge import Adoption, EventLearner, Knowledge, Outcome
from observer_rt.observer.stream.front_end import (
    confirming_samples,
    dead_band,
    ramp_samples,
    samples_ahead,
    toe_samples,
)
from observer_rt.observer.stream.lift_step import LONG_PAST
from observer_rt.observer.stream.outliers import REACH, SLOWEST_FILTER
from observer_rt.observer.stream.pair import FURTHEST_OFFSET
from observer_rt.observer.stream.phi import put_into
from observer_rt.observer.stream.standstill import Standstill, standstill_of
from observer_rt.observer.stream.state import (
    INJECTIONS,
    LINE,
    PENDING_EVENTS,
    RING,
    Constants,
    Observer,
    Reason,
    Timing,
    observer_dtype,
    sample_dtype,
)
from observer_rt.observer.stream.undoing import louder, undoing_of

SETTLE = 3 * MILLISECOND
GOOD = 1 * MILLISECOND
BOUNCE = 0.3 * MILLISECOND
WINDOW_LEAD = 0.15 * MILLISECOND
WINDOW_TAIL = 0.5 * MILLISECOND
LEARNING_LEAD = 1 * MILLISECOND
BRIDGE = 0.5 * MILLISECOND
QUICKEST = 2.0  # times the speeds of the injector file, of which rail pressure and wear make up to 1.4
SLOW_PEAK = 5.0  # with the limit of the watch, five standard deviations


@dataclass(frozen=True)
class Durations:
    """What the user may set of the timing [s]."""

    event_gap: float = 10 * MILLISECOND
    learning_delay: float = 20 * MILLISECOND
    bridge: float = BRIDGE


def constants_for(
    parameters: InjectorParameters,
    sample_rate: float,
    durations: Durations,
    events_required: int,
    rail_every: float = 1.0,
    means: bool = False,
    stated: Sequence[SizedEffect] = (),
) -> Constants:
    """Everything fixed at start-up, for an injector with its effects in force and a sample rate [Hz].

    rail_every: samples to one of the rail pressure; means: samples are means over the sample period before;
    stated: what is to be undone of the channels.
    """
    model = effective_model(parameters, stated)
    interval = 1.0 / sample_rate
    sensor = sensor_of(model.sensor, model.coefficients.pressure_scale, interval)
    toe = toe_samples(model.inputs, interval)

    def samples(duration: float) -> int:
        return round(duration * sample_rate)

    return Constants(
        coefficients=averaged(model.coefficients) if means else model.coefficients,
        inputs=model.inputs,
        sensor=sensor,
        interval=interval,
        substeps=substeps_needed(model.injector, sample_rate, model.departures),
        timing=Timing(
            settle=samples(SETTLE),
            good=samples(GOOD),
            event_gap=samples(durations.event_gap),
            learning_delay=samples(durations.learning_delay),
            window_lead=samples(WINDOW_LEAD),
            window_tail=samples(WINDOW_TAIL),
            learning_lead=samples(LEARNING_LEAD),
            lookahead=max(samples_ahead(interval) + toe, sensor.late + REACH),
            toe=toe,
            ramp=ramp_samples(interval),
            confirm=confirming_samples(interval),
            bounce=samples(BOUNCE),
            bridge=samples(durations.bridge),
            filtered=durations.bridge > 0.0 and interval <= SLOWEST_FILTER,
        ),
        events_required=events_required,
        rail_every=rail_every,
        undoing=undoing_of(model.inputs, interval),
        quickest=QUICKEST * max(parameters.needle.opening_speed, parameters.needle.closing_speed) * interval,
    )


def make_observer(
    constants: Constants, knowledge: Knowledge, learner: EventLearner, healthy: Healthy = NOT_FITTED
) -> Observer:
    """An observer with empty memory that carries `knowledge`; healthy: what its model leaves unexplained."""
    observer = Observer(
        constants,
        np.zeros(1, observer_dtype(len(constants.coefficients.line._fields), knowledge.in_force.size)),
        np.zeros(RING, sample_dtype(constants.coefficients.states)),
        learner.schedule.gains.copy(),
        learner.phi,
    )
    memory = observer.memory[0]
    memory["hidden"] = zero_network().hidden
    memory["phi_version"] = knowledge.phi_version
    memory["healthy_variance"] = healthy.variance.max()
    scale = constants.coefficients.pressure_scale
    noise = knowledge.noise
    memory["stated_noise"] = noise.rail_pressure / scale, noise.line_pressure / scale, noise.needle_lift
    memory["lift_on"], memory["lift_off"] = dead_band(noise.needle_lift * louder(constants.undoing.lift_lag))
    _expect(memory, learner.schedule.innovation_sigma)
    memory["offset_moves"] = knowledge.colour is None
    memory["stepped"] = LONG_PAST
    _put_in_force(observer, knowledge)
    return observer


def event_window(observer: Observer, number: int) -> Window | None:
    """Learning window of the `number`-th closed event (0, 1, ..), copied; None when it cannot be learned."""
    event = observer.memory[0]["events"][number % PENDING_EVENTS]
    if not event["learnable"]:
        return None
    start, end = _window_of(observer, event)
    late = observer.constants.sensor.late
    rows = observer.ring[np.arange(start, end) % RING]
    recorded = observer.ring[np.arange(start + late, end + late) % RING]
    return Window(
        inputs=np.column_stack([rows["rail_pressure"], rows["seat_area"]]),
        output=recorded["line_pressure"],
        resting=rows["resting"].copy(),
        start=np.append(rows["x_tilde"][0], rows["indicated"][0]),
        opening=int(event["opening"]) - start,
        knots=np.column_stack([rows["lift_after"], rows["lift_area"]]),
        masked=(recorded["bridged"] >> LINE & 1).astype(np.bool_),
    )


def event_innovations(observer: Observer, number: int) -> Innovations:
    """Innovations of the live x~ over the learning window of a closed event, copied."""
    memory = observer.memory[0]
    start, end = _window_of(observer, memory["events"][number % PENDING_EVENTS])
    rows = observer.ring[np.arange(start, end) % RING]
    return Innovations(rows["innovation"].copy(), float(memory["innovation_sigma"]))


def _window_of(observer: Observer, event: np.void) -> tuple[int, int]:
    """Positions [start, end) of an event's samples whose line pressure is known."""
    late = observer.constants.sensor.late
    start = max(int(event["window_start"]), -late)
    return start, min(int(event["window_end"]) + 1, int(observer.memory[0]["received"]) - max(late, 0))


def event_standstill(observer: Observer, number: int) -> Standstill:
    """What was known of the standstill when the `number`-th closed event (0, 1, ..) ended.

    Not what is known when somebody asks: that depends on how many samples a frame carries.
    """
    event = observer.memory[0]["events"][number % PENDING_EVENTS]
    stated = observer.memory[0]["stated_noise"]
    return standstill_of(event, observer.constants.coefficients.pressure_scale, stated)


def closed_injections(observer: Observer) -> int:
    """How many injections are over, which is the number of the last of them."""
    memory = observer.memory[0]
    begun = int(memory["injections_begun"])
    is_under_way = begun > 0 and memory["injections"][(begun - 1) % INJECTIONS]["end"] < 0
    return begun - int(is_under_way)


def was_shut(observer: Observer, begin: float, end: float) -> bool:
    """Whether the needle was shut at the index `begin`, and every sample from there to `end` was processed.

    The legal pauses of a windowed source count as processed.
    """
    processed = int(observer.memory["processed"][0])
    if processed == 0:
        return False
    newest = int(observer.ring[(processed - 1) % RING]["index"])
    span = min(processed, RING, max(math.ceil(newest - begin) + 2, 0))
    rows = observer.ring[np.arange(processed - span, processed) % RING]
    anew = np.flatnonzero(rows["broken"] == Break.RESTART)
    rows = rows[anew[-1] :] if anew.size else rows
    first = int(np.searchsorted(rows["index"], begin, side="right")) - 1
    last = int(np.searchsorted(rows["index"], end, side="left"))
    if first < 0 or last == len(rows) or rows["seat_area"][first] > 0.0:
        return False
    broken = rows["broken"][first + 1 : last + 1]
    return bool(np.isin(broken, (Break.NONE, Break.JUMP)).all())


def in_force(observer: Observer) -> NDArray[np.float64]:
    """The parameter vector theta (m,) the observer carries."""
    memory = observer.memory[0]
    return np.array(memory["theta"])


def judge(
    observer: Observer, objections: Sequence[Objection], outcome: Outcome | None, is_coloured: bool = False
) -> None:
    """Judge the oldest waiting event by what speaks against it; put into force what was learned from it, if any.

    is_coloured: whether the innovations are, by what is known of the noise.
    """
    memory = observer.memory[0]
    event = memory["events"][int(memory["events_taken"]) % PENDING_EVENTS]
    memory["events_taken"] += 1
    memory["events_judged"] += 1
    memory["waiting"] = False
    memory["offset_moves"] = not is_coloured
    _note_judgement(memory, event, objections[0].reason if objections else Reason.NONE)
    at_rest = _at_rest(observer) if is_coloured and not objections else None
    if outcome is None:
        if at_rest is not None:
            _expect(memory, float(memory["innovation_sigma"]), at_rest)
        return
    _expect(memory, outcome.schedule.innovation_sigma, at_rest)
    observer.gains[:] = outcome.schedule.gains
    offset = float(memory["offset"])
    _put_in_force(observer, outcome.knowledge)
    furthest = FURTHEST_OFFSET / observer.constants.coefficients.pressure_scale
    has_followed = abs(offset - float(memory["learned_offset"])) < furthest
    if has_followed and not is_coloured:
        memory["offset"] = offset
    put_into(observer.phi, outcome.phi)
    if outcome.adoption is Adoption.ADOPTED:
        memory["phi_version"] += 1


def _expect(memory: np.void, innovation_sigma: float, at_rest: float | None = None) -> None:
    """What innovations are to be like; at_rest: mean square of coloured ones with the needle shut.

    What is slow does not average out in the watch's mean of squares: it may be SLOW_PEAK times its own mean.
    """
    white = innovation_sigma**2 * memory["healthy_variance"]
    slow = 0.0 if at_rest is None else max(at_rest - white, 0.0)
    memory["innovation_sigma"] = innovation_sigma
    memory["innovation_weight"] = 1.0 / (white + SLOW_PEAK * slow)


def _at_rest(observer: Observer) -> float:
    """Mean square of the innovations of the samples at rest that are remembered."""
    processed = int(observer.memory["processed"][0])
    rows = observer.ring[:processed]
    return float(np.mean(rows["innovation"][rows["resting"]] ** 2))


def _note_judgement(memory: np.void, event: np.void, judgement: Reason) -> None:
    """What an event's judgement makes of the samples after it.

    An event with samples that were not to be trusted, or that could not be tested, makes nothing valid; a second in a
    row that could not be tested, though its samples were to be trusted, ends what was known. A contradiction is over
    with an event that passed, or with the one it came in, if that was of samples that were not to be trusted.
    """
    is_untested = judgement is Reason.NOT_JUDGED
    memory["doubtful_events"] += bool(event["doubtful"]) or is_untested
    if not is_untested:
        memory["untested"] = 0
        memory["judgement"] = judgement
    elif not event["doubtful"]:
        memory["untested"] += 1
        if memory["untested"] > 1:
            memory["judgement"] = judgement
    is_passed = judgement is Reason.NONE and event["number"] >= memory["contradicted_in"]
    is_explained = bool(event["doubtful"]) and event["number"] == memory["contradicted_in"]
    if is_passed or is_explained:
        memory["contradicted"] = False


def _put_in_force(observer: Observer, knowledge: Knowledge) -> None:
    memory = observer.memory[0]
    learned = learned_of(knowledge.in_force, observer.constants.coefficients, knowledge.scalars)
    memory["theta"] = knowledge.in_force
    memory["output"] = learned.network.output
    memory["bias"] = learned.network.bias
    memory["back_pressure"] = learned.network.back_pressure
    sensor = observer.constants.sensor
    memory["learned_offset"] = memory["offset"] = sensor.offset + learned.offset
    memory["lag"] = sensor.lag + learned.lag
    memory["line"] = learned.coefficients.line
    noise = knowledge.noise
    scale = observer.constants.coefficients.pressure_scale
    memory["channels"]["noise"] = noise.rail_pressure / scale, noise.needle_lift, noise.line_pressure / scale
