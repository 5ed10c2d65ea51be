"""The observer as Python handles it: made, given constants and commands, and read: events and samples of its ring."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import rest_state
from observer_rt.core.stream import stream as core
from observer_rt.core.stream.stepper import Stepper
from observer_rt.engine.estimation.predictor import SETTLE, Window
from observer_rt.engine.learning.adequacy import Innovations
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.mailbox import begin_with
from observer_rt.engine.stream import state
from observer_rt.engine.stream.standstill import Standstill, standstill_of
from observer_rt.foundation.units import MILLISECOND, Floats, Structs
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import Clock, averaged, sensor_of
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import substeps_needed

GOOD = 1 * MILLISECOND  # of a shut needle, after which x~ is good again
BOUNCE = 0.3 * MILLISECOND  # of a shut needle, after which its lift is its zero
STAYS = 10 * MILLISECOND  # after which a low lift that the line pressure does not show is no open needle's
WINDOW_LEAD, WINDOW_TAIL = 0.15 * MILLISECOND, 0.5 * MILLISECOND  # of an injection's window round its opening
LEARNING_LEAD = 1 * MILLISECOND  # of an event's window before its first opening
BRIDGE = 0.5 * MILLISECOND  # longest gap of a channel that is bridged
SLOWEST_FILTER = 21e-6  # s of a sample period, up to which three samples are short for a line
INDICES = 1 << 32  # after which a sample index begins again
QUICKEST = 2.0  # times the speeds of the injector file, of which rail pressure and wear make up to 1.4


@dataclass(frozen=True)
class Durations:
    """Timing [s] that the user may set."""

    event_gap: float = 10 * MILLISECOND  # within which openings are one event
    learning_delay: float = 20 * MILLISECOND  # from an event's closing until what it taught is in force
    bridge: float = BRIDGE  # longest gap of a channel that is bridged; 0: none, nor is a spike replaced


def constants_for(
    parameters: InjectorParameters,
    sample_rate: float,
    durations: Durations,
    events_required: int,
    rail_every: float = 1.0,
    means: bool = False,
    stated: Sequence[SizedEffect] = (),
    calibration: StatedAccuracy = EXACT,
) -> state.Constants:
    """Everything fixed at start-up, for an injector with its effects in force and a sample rate [Hz].

    rail_every: samples to one of the rail pressure; means: samples are means over the sample period before; stated:
    delays and lags of the channels to be undone. calibration: of level and pressure sensors.
    """
    model = effective_model(parameters, stated)
    interval = 1.0 / sample_rate
    sensor = sensor_of(model.sensor, model.coefficients.pressure_scale, interval)
    # most samples of an opening ramp that the recorded lift does not show
    toe = math.ceil(max(model.inputs.lift_shift, 0.0) / (core.SLOWEST_OPENING * interval))

    def samples(duration: float) -> int:
        return round(duration * sample_rate)

    return state.Constants(
        coefficients=averaged(model.coefficients) if means else model.coefficients,
        means=means,
        inputs=model.inputs,
        sensor=sensor,
        interval=interval,
        substeps=substeps_needed(model.injector, sample_rate, model.departures),
        timing=core.Timing(
            settle=samples(SETTLE),
            good=samples(GOOD),
            event_gap=samples(durations.event_gap),
            learning_delay=samples(durations.learning_delay),
            window_lead=samples(WINDOW_LEAD),
            window_tail=samples(WINDOW_TAIL),
            learning_lead=samples(LEARNING_LEAD),
            lookahead=max(state.samples_ahead(interval) + toe, sensor.late + core.REACH),
            toe=toe,
            ramp=state.ramp_samples(interval),
            confirm=state.confirming_samples(interval),
            bounce=samples(BOUNCE),
            stays=samples(STAYS),
            bridge=samples(durations.bridge),
            filtered=durations.bridge > 0.0 and interval <= SLOWEST_FILTER,
        ),
        events_required=events_required,
        rail_every=rail_every,
        undoing=state.undoing_of(model.inputs, interval),
        quickest=QUICKEST * max(parameters.needle.opening_speed, parameters.needle.closing_speed) * interval,
        program=model.program,
        calibration=calibration,
    )


def make_observer(
    constants: state.Constants, knowledge: Knowledge, learner: Learner, healthy: Healthy = NOT_FITTED
) -> state.Observer:
    """An observer that has seen no sample and carries `knowledge`; healthy: what its model leaves unexplained."""
    observer = _empty_observer(constants, knowledge.in_force.size, learner.schedule.gains.shape)
    memory = observer.memory[0]
    prior, judgement, resting = memory["prior"], memory["judgement"], memory["resting_lift"]
    scale, noise, lift = constants.coefficients.pressure_scale, knowledge.state.noise, knowledge.lift
    prior["healthy_variance"] = healthy.live_variance
    prior["stated_noise"] = noise.rail_pressure / scale, noise.line_pressure / scale, noise.needle_lift
    judgement["phi_version"] = knowledge.phi_version
    judgement["offset_moves"] = knowledge.state.learned.colour is None
    memory["dead_band"] = core.dead_band(noise.needle_lift * state.noise_gain(constants.undoing.lift_lag))
    resting["zero"] = lift.zero
    resting["quick_squares"] = lift.wander**2
    resting["crosstalk"] = lift.crosstalk * scale
    for mean in ("mean", "near", "behind"):
        memory["lift_zero"][mean] = lift.zero
    memory["lift_step"]["stepped"] = core.LONG_PAST
    memory["mode"]["waits_for_verdicts"] = True
    begin_with(observer, knowledge, learner.schedule)
    return observer


def _empty_observer(constants: state.Constants, parameters: int, gains: tuple[int, ...]) -> state.Observer:
    """An observer whose memory is all 0, for so many parameters and a gain schedule of this shape."""
    pair, verdicts = (core.RING, constants.coefficients.states), 2 * core.SLOTS
    memory = (
        np.zeros(1, core.MEMORY),
        np.zeros(core.RECORDED_RING, core.RECORDED),
        np.zeros(core.RING, core.SAMPLE),
        np.zeros(pair),
        np.zeros(pair),
        np.zeros(gains),
        np.zeros(core.PENDING_EVENTS, core.EVENT),
        np.zeros(core.INJECTIONS, core.INJECTION),
        np.zeros(3, core.CHANNEL),
        np.zeros(parameters),
        np.zeros(verdicts, core.VERDICT),
        np.zeros((verdicts, *gains)),
        np.zeros((verdicts, parameters)),
    )
    stream = core.Stream(*memory)
    return state.Observer(constants, *memory, stream, _bound_stepper(stream, constants))


def with_constants(observer: state.Observer, constants: state.Constants) -> state.Observer:
    """Observer that goes on with other constants."""
    c, before = constants.coefficients, observer.constants.coefficients
    if c.chamber_pressure != before.chamber_pressure:
        _raise_origin(observer, (c.chamber_pressure - before.chamber_pressure) / c.pressure_scale)
    stepper = _bound_stepper(observer.stream, constants, observer.stepper)
    return observer._replace(constants=constants, stepper=stepper)


def _raise_origin(observer: state.Observer, rise: float) -> None:
    """Let remembered pressures count from a chamber pressure `rise` [p_0] higher, that of a sac at rest."""
    memory, line = observer.memory[0], np.zeros(observer.x_hat.shape[1])
    rest_state(line, rise, observer.constants.coefficients)
    for states in (observer.x_tilde, observer.x_hat):
        states -= line
    for name in ("rail_pressure", "line_pressure", "indicated"):
        observer.ring[name] -= rise
    for name in ("last", "instead", "held"):
        observer.channels[name][[0, 2]] -= rise
    memory["crosstalk"]["line_mean"] -= rise
    memory["rest"]["highest_line"] -= rise


def _bound_stepper(stream: core.Stream, constants: state.Constants, before: Stepper | None = None) -> Stepper:
    stepper = Stepper(stream, constants)
    if before is not None:
        stepper.go_on_from(before)
    stream.put_constants(constants)
    stream.bind(stepper)
    return stepper


def samples_between(earlier: Any, later: Any) -> Any:
    """Samples from one index to another, either of them modulo 2^32; nan if one is not known."""
    return (later - earlier + INDICES / 2) % INDICES - INDICES / 2


def energize(observer: state.Observer, number: int, start: int, length: float = math.inf) -> None:
    """Store the `number`-th command (0, 1, ..) for the pilot valve; again, once its end is known.

    start: index of its first sample; length [samples]: infinite as long as it is not known.
    """
    commands = observer.memory[0]["commands"]
    commands["starts"][number % core.COMMANDS], commands["lengths"][number % core.COMMANDS] = start, length
    commands["count"] = max(int(commands["count"]), number + 1)


def commands_at(observer: state.Observer, start: int, end: int) -> Floats:
    """Commands (k, 2) as of `Window` that begin in, or not long before, positions [start, end)."""
    commands = observer.memory[0]["commands"]
    kept = np.arange(max(int(commands["count"]) - core.COMMANDS, 0), int(commands["count"])) % core.COMMANDS
    first = observer.ring["index"][start % core.RING]
    begun: Floats = samples_between(first, commands["starts"][kept])
    within = np.abs(begun) < end - start
    return np.column_stack((begun, begun + commands["lengths"][kept]))[within]


def event_window(observer: state.Observer, number: int) -> Window | None:
    """Learning window of the `number`-th closed event (0, 1, ..), copied; None if nothing can be learned from it."""
    event = observer.events[number % core.PENDING_EVENTS]
    if not event["learnable"]:
        return None
    start, end = _window_of(observer, event)
    return window_between(observer, start, end, int(event["opening_position"]), int(event["injections"]))


def window_between(observer: state.Observer, start: int, end: int, opening: int, injections: int) -> Window:
    """Window of the samples at positions [start, end), copied; injections: begun before its end."""
    samples = max(0, end - start)
    window = Window(
        inputs=np.empty((samples, 2)),
        output=np.empty(samples),
        resting=np.empty(samples, np.bool_),
        start=np.append(observer.x_tilde[start % core.RING], observer.ring[start % core.RING]["indicated"]),
        opening=opening - start,
        knots=np.empty((samples, 2)),
        masked=np.empty(samples, np.bool_),
    )
    columns = window.inputs, window.output, window.resting, window.knots, window.masked
    core.copy_window(observer.ring, start, observer.constants.sensor.late, *columns)
    openings = np.count_nonzero(np.diff(window.inputs[:, 1] > 0.0, prepend=False) & (window.inputs[:, 1] > 0.0))
    begun = Clock(start * observer.constants.interval, float(injections - openings))
    return window._replace(clock=begun, commands=commands_at(observer, start, end), needle=observer.constants.needle)


def remembered(ring: NDArray[Any], start: int, end: int) -> NDArray[Any]:
    """Samples, or a column of them, at positions [start, end): a view, where they do not lie round the ring's end."""
    first, last = start % core.RING, (end - 1) % core.RING + 1
    if start >= end:
        return ring[:0]
    return ring[first:last] if first < last else np.concatenate((ring[first:], ring[:last]))


def samples_at(observer: state.Observer, start: int, end: int) -> Structs:
    """Samples at positions [start, end), with x~ and x^, copied; dtype `sample_dtype`."""
    rows = np.empty(max(0, end - start), state.sample_dtype(observer.x_hat.shape[1]))
    rows[list(core.SAMPLE.names or ())] = remembered(observer.ring, start, end)
    rows["x_tilde"], rows["x_hat"] = (remembered(states, start, end) for states in (observer.x_tilde, observer.x_hat))
    return rows


def event_innovations(observer: state.Observer, number: int) -> Innovations:
    """Innovations of the live x~ over the learning window of a closed event, copied."""
    start, end = _window_of(observer, observer.events[number % core.PENDING_EVENTS])
    innovations = remembered(observer.ring["innovation"], start, end)
    return Innovations(innovations.copy(), float(observer.memory[0]["innovation_noise"]["sigma"]))


def _window_of(observer: state.Observer, event: np.void) -> tuple[int, int]:
    """Positions [start, end) of an event's samples whose line pressure is known."""
    late = observer.constants.sensor.late
    start = max(int(event["start_position"]), -late)
    received = int(observer.memory[0]["positions"]["received"])
    return start, min(int(event["end_position"]) + 1, received - max(late, 0))


def event_standstill(observer: state.Observer, number: int) -> Standstill:
    """Standstill when the `number`-th closed event ended: later knowledge depends on the frames' size."""
    event = observer.events[number % core.PENDING_EVENTS]
    stated = observer.memory[0]["prior"]["stated_noise"]
    return standstill_of(event, observer.constants.coefficients.pressure_scale, stated)


def was_shut(observer: state.Observer, begin: float, end: float) -> bool:
    """True if the needle was shut at index `begin`, and samples to `end` were processed or legally paused."""
    processed = int(observer.memory[0]["positions"]["processed"])
    if processed == 0:
        return False
    newest = int(observer.ring[(processed - 1) % core.RING]["index"])
    span = min(processed, core.RING, max(math.ceil(newest - begin) + 2, 0))
    rows = remembered(observer.ring, processed - span, processed)
    anew = np.flatnonzero(rows["broken"] == core.Break.RESTART)
    rows = rows[anew[-1] :] if anew.size else rows
    first = int(np.searchsorted(rows["index"], begin, side="right")) - 1
    last = int(np.searchsorted(rows["index"], end, side="left"))
    if first < 0 or last == len(rows) or rows["seat_area"][first] > 0.0:
        return False
    return bool(np.isin(rows["broken"][first + 1 : last + 1], (core.Break.NONE, core.Break.JUMP)).all())
