"""Learning between events: everything jointly, by prediction error, as a Bayesian update."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels, gain_schedule
from observer_rt.engine.estimation.gating import GatedBelief
from observer_rt.engine.estimation.phases import Phase, PhaseStatistics
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import SCALARS, Parameter, Theta, learned_of, sensor_lag
from observer_rt.engine.learning.adequacy import (
    Innovations,
    Objection,
    event_statistics,
    is_worn_beyond_limits,
    looks_like_inertance,
    objections,
    pooled,
)
from observer_rt.engine.learning.disturbances.colour import offset_between
from observer_rt.engine.learning.disturbances.noise_levels import Sigmas, median
from observer_rt.engine.learning.event_fit import Believed, EventReader, Explained, temper_in
from observer_rt.engine.learning.fallback import UNEXPLAINED, Rehearsed, best_explaining, is_better
from observer_rt.engine.learning.forgetting import Cause
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.indicators import nozzle_change
from observer_rt.engine.learning.interval import resimulated
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.learning.learned_range import (
    UNSEEN,
    extrapolation_sigma,
    known_flow,
    operating_point,
    remembered,
)
from observer_rt.engine.learning.lift_lag import LiftLag, lift_lag_of
from observer_rt.engine.learning.pressure_lag import lag_score, lateness_of
from observer_rt.engine.learning.state import LearnedInjector, LearningState, no_state
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.units import MEGAPASCAL

STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
OTHER_NOISE = 1.25  # times a level
# Between rail and line at rest: another unit, or no sensor; nothing to be learned.
IMPLAUSIBLE = 15 * MEGAPASCAL
# Of the rail pressure in an event, and more than the line's by this factor.
SWINGS, SWAPPED = 2 * MEGAPASCAL, 3.0


def implausible(window: Window, pressure_scale: float) -> Objection | None:
    """Objection, before any fit, to pressures of an event that are not those of rail and line; p_0 [Pa].

    The rail hardly moves when the needle opens, the line does: where it is the other way round, they are swapped.
    """
    before, rail = slice(0, max(window.opening, 1)), window.inputs[:, 0]
    if abs(median(window.output[before] - rail[before])) * pressure_scale > IMPLAUSIBLE:
        return Objection(Reason.PRESSURE_OFFSET, Phase.STANDSTILL)
    rail_swing = float(np.std(rail))
    if rail_swing * pressure_scale > SWINGS and rail_swing > SWAPPED * float(np.std(window.output)):
        return Objection(Reason.CONTRADICTED)
    return None


class ClosedEvent(NamedTuple):
    """A closed event; standstill: when it ended; in_force (m,), constants: during it."""

    window: Window
    standstill: Standstill
    in_force: Theta
    constants: Constants


@dataclass(frozen=True, eq=False)
class Given:
    """Constants of an injector's learning; gains_for: `gain_schedule`, which most events ask for the same."""

    reader: EventReader
    gains_for: Callable[..., GainSchedule]

    def gains(self, theta: Theta, noise: NoiseLevels, constants: Constants) -> GainSchedule:
        """Those of x~ with theta (m,): with others a line with waves may swing ever higher."""
        learned = learned_of(theta, constants.coefficients)
        sensor, rate = constants.sensor, 1.0 / constants.interval
        lag = sensor.lag + float(learned.sensor[0])
        return self.gains_for(learned.coefficients, noise, rate, lag, sensor.fraction, constants.rail_every)

    def contradictions(self, statistics: PhaseStatistics, theta: Theta) -> list[Objection]:
        """Objections of statistics, and of the sensor as it is in theta (m,), to the model."""
        offset = float(theta[Parameter.LINE_PRESSURE_OFFSET]) * self.reader.pressure_scale
        return objections(statistics, offset, sensor_lag(theta), self.reader.healthy)

    def statistics_of(self, event: Explained) -> PhaseStatistics:
        """Statistics of an event's innovations."""
        innovations = Innovations(event.fit.innovations, event.cost.sigma)
        return event_statistics(event.window, innovations, self.reader.interval, self.reader.healthy)

    def gated(self, state: LearningState) -> GatedBelief:
        """The belief as the estimate has it."""
        return GatedBelief(state.learned.belief, SCALARS.gate, state.learned.active)


class Learner:
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    def __init__(
        self,
        constants: Constants,
        knowledge: Knowledge,
        healthy: Healthy = NOT_FITTED,
    ) -> None:
        """constants: at the start; healthy: what the model leaves unexplained of a healthy injector."""
        scale, noise = constants.coefficients.pressure_scale, knowledge.state.noise
        reader = EventReader(constants.interval, scale, no_state(noise, scale), healthy)
        self._given = Given(reader, lru_cache(maxsize=2)(gain_schedule))
        self._constants = constants
        self.schedule = self._given.gains(knowledge.in_force, noise, constants)
        """Gains at the start."""
        self.state = knowledge.state.begun(knowledge.in_force, constants.interval, healthy.overdispersion)
        """State after the last event."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Go on by one event, during which `in_force` (m,) was carried; its constants, None: as at the start."""
        event = ClosedEvent(window, standstill, in_force, constants or self._constants)
        outcome = learn(self.state, event, self._given)
        self.state = outcome.knowledge.state
        return outcome


def learn(state: LearningState, event: ClosedEvent, given: Given) -> Outcome:
    """Learn from one event, and decide whether its estimate is adopted in place of what was in force.

    The outcome's knowledge has the state to go on from. An event that is not explained changes no more of that than
    noise levels and standstill.
    """
    outcome = _outcome_of(state, event, given)
    state, in_force = outcome.knowledge.state, outcome.knowledge.in_force
    passed = not outcome.objections
    checkpoint = state.checkpoint.after(state.learned, state.gains, state.at_rest, passed)
    passed_with = in_force if passed else state.passed_with
    state = replace(state, checkpoint=checkpoint, passed_with=passed_with)
    if not passed:
        state = given.reader.forgotten(state, Cause.NOT_PASSED)
    outcome = replace(outcome, knowledge=replace(outcome.knowledge, state=state))
    if outcome.adoption is Adoption.ADOPTED:
        return outcome
    return replace(outcome, schedule=given.gains(in_force, state.noise, event.constants))


def _outcome_of(state: LearningState, event: ClosedEvent, given: Given) -> Outcome:
    """Outcome of an event, but for what the state remembers of whether it passed."""
    window, standstill = event.window, event.standstill
    if standstill.noise is not None:
        state = _with_noise(state, standstill.noise, given)
    schedule = given.gains(state.learned.theta, state.noise, event.constants)
    state = replace(state, held_rail=state.held_rail.after(window, standstill, event.constants.rail_every))
    objection = implausible(window, given.reader.pressure_scale)
    if state.held_rail.is_held:
        objection = Objection(Reason.INPUT_FROZEN)
    if objection is not None:
        return _failed(state, event, schedule, objection, given)
    offset = offset_between(state.standstill, standstill)
    state = replace(_with_first_offset(state, standstill), standstill=standstill)
    try:
        read = _read_as_before(state, event, given) or _read(state, event, schedule, offset, given)
        if read is not None:
            return _outcome_read(read, event, given)
    except np.linalg.LinAlgError:
        pass
    return _failed(state, event, schedule, Objection(Reason.NOT_LEARNED), given)


def _with_noise(state: LearningState, noise: NoiseLevels, given: Given) -> LearningState:
    """Sets the noise levels from an event on: what an event was by others says nothing by these."""
    before = state.noise
    if any(
        abs(math.log(now / then)) > math.log(OTHER_NOISE)
        for now, then in (
            (noise.rail_pressure, before.rail_pressure),
            (noise.line_pressure, before.line_pressure),
        )
    ):
        state = given.reader.forgotten(state, Cause.OTHER_NOISE)
    return replace(state, noise=noise)


def _with_first_offset(state: LearningState, standstill: Standstill) -> LearningState:
    """Where nothing was learned yet, the first event is explained from the offset at rest."""
    learned = state.learned
    if not learned.is_prior or standstill.samples < STANDSTILL_ENOUGH:
        return state
    mean, theta = learned.belief.mean.copy(), learned.theta.copy()
    mean[Parameter.LINE_PRESSURE_OFFSET] = theta[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
    return replace(state, learned=replace(learned, belief=replace(learned.belief, mean=mean), theta=theta))


@dataclass(frozen=True, eq=False)
class _Read:
    """An event as far as it is understood, and by what; state: after that, schedule: by which x~ follows."""

    state: LearningState
    event: Explained
    believed: Believed
    schedule: GainSchedule


def _read_as_before(state: LearningState, event: ClosedEvent, given: Given) -> _Read | None:
    """An event explained by what was believed before others did not pass: that is believed again. None: it is not.

    What stood still before it does not count: it is of the fault.
    """
    checkpoint = state.checkpoint
    if checkpoint.learned is None or not checkpoint.is_worth_trying:
        return None
    before = replace(state, learned=checkpoint.learned, gains=checkpoint.gains, at_rest=checkpoint.at_rest)
    schedule = given.gains(before.learned.theta, state.noise, event.constants)
    try:
        read = _read(before, event, schedule, None, given)
    except np.linalg.LinAlgError:
        return None
    if read is None or not _is_as_believed(read, given):
        return None
    believed = read.believed._replace(again=True)
    return replace(read, state=given.reader.forgotten(read.state, Cause.PASSED), believed=believed)


def _read(
    state: LearningState, event: ClosedEvent, schedule: GainSchedule, offset: float | None, given: Given
) -> _Read | None:
    """An event explained, None where no fit is finite; offset: line over rail pressure at rest before it [p_0].

    Raises numpy.linalg.LinAlgError when singular.
    """
    rail_pressure, belief = float(event.window.inputs[:, 0].mean()), state.learned.belief
    believed = Believed(
        setting_of(event.constants, schedule),
        Sigmas(schedule.innovation_sigma, state.noise.line_pressure / given.reader.pressure_scale),
        None if offset is None else state.gains.undone_offset(offset, rail_pressure),
        belief if state.learned.is_prior else state.gains.rescaled(belief.drifted(given.reader.drift)),
    )
    undone = state.energizing.current.undone(_without_gains(state, event.window))
    state, found = given.reader.explained(state, undone, believed)
    return None if found is None else _Read(state, found, believed, schedule)


def _without_gains(state: LearningState, window: Window) -> Window:
    return window._replace(output=state.gains.undone(window.output))


def _is_as_believed(read: _Read, given: Given) -> bool:
    """Whether an event, with those before the trouble, contradicts nothing that it was explained by."""
    fit = read.event.fit
    theta = fit.linearisation.theta
    statistics = pooled(read.state.learned.statistics, given.statistics_of(read.event))
    is_contradicted = fit.contradicts or given.contradictions(statistics, theta)
    return not (is_contradicted or is_worn_beyond_limits(theta))


def _outcome_read(read: _Read, event: ClosedEvent, given: Given) -> Outcome:
    """Outcome of an event that was explained. Raises numpy.linalg.LinAlgError when singular."""
    reader, found, believed, setting = given.reader, read.event, read.believed, read.believed.setting
    lag = lag_score(found.window, setting, found.fit, found.cost, reader.wide)
    gated = GatedBelief(found.fit.prior, SCALARS.gate, read.state.learned.active)
    carried = gated.carried(event.in_force)
    recorded = _without_gains(read.state, event.window)
    undone = read.state.energizing.current.undone(recorded)
    state = _taken_in(read.state, found, given)
    state, is_ending = reader.with_range(state, found, undone, believed)
    state, is_disturbed = _with_energizing(state, read, recorded, given)
    theta, gated = state.learned.theta, given.gated(state)
    point = operating_point(found.window, event.constants.interval)
    by_coil = state.energizing.current.covariance
    more = np.zeros_like(gated.covariance) if by_coil is None else by_coil
    now = gated.carried(theta) + more
    again = resimulated(found.window, setting, state.noise, theta, now, carried + more)
    systematic = math.hypot(
        reader.healthy.mass_share,
        UNSEEN * extrapolation_sigma(point, state.learned_at),
        state.gains.flow_share,
    )
    state = replace(
        state,
        learned_at=remembered(state.learned_at, point),
        lag_doubt=state.lag_doubt.after(None if lag is None else lateness_of(lag, again.run)),
    )
    state, reasons = _with_reasons(state, found, given)
    this = Rehearsed(found.window, setting, float(theta[Parameter.LINE_PRESSURE_OFFSET]))
    rehearsed = [this] if state.last_event is None else [state.last_event, this]
    state = replace(state, last_event=this, freezer=state.freezer.after(state.learned.statistics))
    if state.freezer.frozen:
        against = _objections(state, found.window, (), given)
        against = against or (Objection(Reason.MODEL_INADEQUATE, Phase.STANDSTILL),)
        outcome = _outcome(Adoption.FROZEN, state, np.zeros_like(theta), read.schedule, against, gated, given)
        knowledge = replace(outcome.knowledge, state=reader.forgotten(state, Cause.FROZEN))
        return replace(outcome, knowledge=knowledge, objections=_because(against, is_ending, is_disturbed))
    better = is_better(rehearsed, theta, event.in_force, state.learned.colour)
    adoption = Adoption.ADOPTED if better or believed.again else Adoption.REJECTED
    against = _because(_objections(state, found.window, reasons, given), is_ending, is_disturbed)
    lift_lag, against = state.lift_lag.after(against, lambda lag: _lift_lag_in(state, read, lag, given))
    relapses, mistrust = state.relapses.after(against), state.mistrust.after(against)
    against = mistrust.reported(against)
    if relapses.last:
        against = against or (Objection(Reason.MODEL_INADEQUATE),)
    state = replace(state, lift_lag=lift_lag, mistrust=mistrust, relapses=relapses)
    because = mistrust.objection
    if because is not None:
        carried_on = _carried_after(because, state, rehearsed)
        against = against or (because,)
        return _outcome(Adoption.SET_ASIDE, state, carried_on, read.schedule, against, gated, given)
    if state.checkpoint.learned is not None and any(each.reason in UNEXPLAINED for each in against):
        adoption = Adoption.REJECTED
    taken = theta if adoption is Adoption.ADOPTED else event.in_force
    return replace(
        _outcome(adoption, state, taken, read.schedule, against, gated, given),
        resimulated=replace(again, systematic=math.hypot(systematic, state.lag_doubt.volume_share)),
        outliers=int(found.window.masked.sum()) - int(undone.masked.sum()),
        loudest=state.jitter.loudest(found.window, believed.sigmas.innovation),
        known=known_flow(again, taken, gated.carried(taken), state.learned_at[-1]),
        prior=found.fit.prior,
    )


def _taken_in(state: LearningState, event: Explained, given: Given) -> LearningState:
    """The fitted event into statistics and belief, there tempered where its innovations are coloured."""
    if event.is_louder:
        state = given.reader.forgotten(state, Cause.STEEP_NOISE)
    statistics = given.statistics_of(event)
    here, learned = event.fit.linearisation, state.learned
    temper = temper_in(state, statistics, state.noise.rail_pressure / given.reader.pressure_scale)
    temper = max(temper / event.cost.temper, 1.0)
    rail_pressure = float(event.window.inputs[:, 0].mean())
    found = float(here.theta[Parameter.LINE_PRESSURE_OFFSET])
    return replace(
        state,
        learned=LearnedInjector(
            belief=event.fit.prior.updated(here.information / temper, here.vector / temper),
            theta=here.theta,
            statistics=pooled(learned.statistics, statistics),
            active=event.fit.active,
            is_prior=False,
            colour=event.colour,
        ),
        events=state.events + 1,
        gains=state.gains.after(state.gains.as_recorded(found, rail_pressure), rail_pressure),
    )


def _with_energizing(
    state: LearningState, read: _Read, recorded: Window, given: Given
) -> tuple[LearningState, bool]:
    """Whether energizing the coil shows in an event that had all of it; recorded: as it was.

    Once it is taken out, what was learned and objected so far was of other line pressures than those that come.
    """
    reader, event = given.reader, read.event
    whole = event.window._replace(output=recorded.output)
    unaware, before = read.believed._replace(offset=None), state
    energizing, is_disturbed = state.energizing.after(
        whole,
        event.fit,
        event.cost.sigma,
        lambda window: reader.cost_of(before, window, unaware),
        reader.wide,
        reader.interval,
    )
    is_new = energizing.is_known and not state.energizing.is_known
    state = replace(state, energizing=energizing)
    return reader.forgotten(state, Cause.COIL) if is_new else state, is_disturbed


def _with_reasons(
    state: LearningState, event: Explained, given: Given
) -> tuple[LearningState, Sequence[Reason]]:
    """Reasons against an event that arise beside its innovations."""
    reasons = []
    before, now = sensor_lag(event.fit.prior.mean), sensor_lag(state.learned.theta)
    state = replace(state, slowed=state.slowed.after(before, now, event.fit.contradicts))
    if state.slowed.is_slowed:
        reasons.append(Reason.SENSOR_LAG)
    if state.lag_doubt.is_relevant:
        reasons.append(Reason.TIME_BASE)
    if event.fit.contradicts:
        reasons.append(Reason.SUDDEN_CHANGE)
        state = given.reader.forgotten(state, Cause.SUDDEN_CHANGE)
    return state, reasons


def _carried_after(because: Objection, state: LearningState, events: Sequence[Rehearsed]) -> Theta:
    """Theta (m,) carried where events are not explained: of all that once explained some the best at them.

    What was learned from them explains nothing. The nominal model where the scale is not known: another one
    explains the pressures as well, with other masses.
    """
    nominal = np.zeros_like(state.learned.theta)
    if because.reason is Reason.AMBIGUOUS_SCALE:
        return nominal
    candidates = [nominal, state.passed_with]
    if state.checkpoint.learned is not None:
        candidates.append(state.checkpoint.learned.theta)
    return best_explaining(events, candidates, state.learned.colour)


def _lift_lag_in(state: LearningState, read: _Read, expected: float, given: Given) -> LiftLag:
    """The lag of the lift that explains an event best; expected: [s]."""
    return lift_lag_of(
        read.event.window,
        read.believed.setting,
        lambda window: given.reader.cost_of(state, window, read.believed),
        expected,
    )


def _failed(
    state: LearningState, event: ClosedEvent, schedule: GainSchedule, objection: Objection, given: Given
) -> Outcome:
    """Outcome of an event that nothing was learned from."""
    gated = given.gated(state)
    return _outcome(Adoption.FAILED, state, event.in_force, schedule, (objection,), gated, given)


def _outcome(
    adoption: Adoption,
    state: LearningState,
    in_force: Theta,
    schedule: GainSchedule,
    against: tuple[Objection, ...],
    gated: GatedBelief,
    given: Given,
) -> Outcome:
    """Outcome with `in_force` (m,) to be carried; gated: the belief of the state."""
    return Outcome(
        adoption=adoption,
        knowledge=Knowledge(state, in_force),
        schedule=schedule,
        objections=against,
        estimate=state.learned.theta,
        covariance=gated.covariance + np.diag(state.unseen_variance),
    )


def _objections(
    state: LearningState, window: Window, reasons: Sequence[Reason], given: Given
) -> tuple[Objection, ...]:
    """Objections to an event; reasons: that arose while it was fitted."""
    theta = state.learned.theta
    result = given.contradictions(state.learned.statistics, theta)
    if state.gains.is_too_large and Objection(Reason.PRESSURE_OFFSET) not in result:
        result.insert(0, Objection(Reason.PRESSURE_OFFSET))
    if is_worn_beyond_limits(theta):
        result.append(Objection(Reason.MODEL_INADEQUATE, Phase.OPEN))
    result.extend(Objection(reason) for reason in reasons)
    if looks_like_inertance(_open_nozzle_change(theta, window), float(theta[Parameter.BULK_MODULUS])):
        result.append(Objection(Reason.AMBIGUOUS_SCALE))
    return tuple(result)


def _because(against: tuple[Objection, ...], is_ending: bool, is_disturbed: bool) -> tuple[Objection, ...]:
    """Objections with what is known of the line pressure as the first: that is why there are others."""
    if is_disturbed:  # though all else may look right
        return (Objection(Reason.CONTRADICTED), *against)
    return (Objection(Reason.INPUT_CLIPPED), *against) if is_ending and against else against


def _open_nozzle_change(theta: Theta, window: Window) -> float:
    """N_H with the needle as open as it was in an event, at the steady sac pressure of the rail pressure."""
    widest = int(np.argmax(window.inputs[:, 1]))
    u = window.inputs[widest]
    return nozzle_change(theta, np.array([u[0], 0.0, 0.9 * u[0]]), u)[0]


def setting_of(constants: Constants, schedule: GainSchedule) -> Setting:
    """Setting by which x~ is followed over an event."""
    sensor = constants.sensor
    return Setting(
        interval=constants.interval,
        substeps=constants.substeps,
        coefficients=constants.coefficients,
        gain=schedule.gains[-1].copy(),
        late=sensor.fraction,
        lag=sensor.lag,
        offset=sensor.offset,
        program=constants.program,
    )
