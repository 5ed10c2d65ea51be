"""Learning between events: everything jointly, by prediction error, as a Bayesian update."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import GainSchedule, NoiseLevels, gain_schedule
from observer_rt.engine.estimation.gating import Belief, GatedBelief
from observer_rt.engine.estimation.phases import Phase, PhaseStatistics, no_statistics
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import SCALARS, Parameter, Scalars, Theta, learned_of, sensor_lag
from observer_rt.engine.learning.adequacy import (
    Innovations,
    Objection,
    event_statistics,
    is_worn_beyond_limits,
    looks_like_inertance,
    objections,
    of_standstill,
    pooled,
)
from observer_rt.engine.learning.disturbances.coil_current import Energizing
from observer_rt.engine.learning.disturbances.colour import OffsetSince
from observer_rt.engine.learning.disturbances.held_rail import HeldRail
from observer_rt.engine.learning.disturbances.noise_levels import Sigmas, median
from observer_rt.engine.learning.disturbances.pressure_gains import PressureGains
from observer_rt.engine.learning.explained import Believed, EventReader, Explained
from observer_rt.engine.learning.fallback import (
    UNEXPLAINED,
    BelievedSoFar,
    Checkpoint,
    Freezer,
    Mistrust,
    Rehearsed,
    best_explaining,
    is_better,
)
from observer_rt.engine.learning.forgetting import FORGOTTEN, Cause, Forgotten
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.indicators import nozzle_change
from observer_rt.engine.learning.interval import (
    UNSEEN,
    Resimulated,
    known_flow,
    operating_point,
    remembered,
    resimulated,
    unfamiliarity,
)
from observer_rt.engine.learning.knowledge import (
    Adoption,
    Knowledge,
    Outcome,
    no_knowledge,
)
from observer_rt.engine.learning.lateness import (
    LagDoubt,
    LiftLag,
    LiftLagSearch,
    SlowedSensor,
    lag_score,
    lateness_of,
    lift_lag_of,
)
from observer_rt.engine.learning.memory import Memory, Tracker
from observer_rt.engine.stream.phi import StructuredPhi
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants, Reason
from observer_rt.foundation.units import MEGAPASCAL

STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
OTHER_NOISE = 1.25  # times a level
IMPLAUSIBLE = (
    15 * MEGAPASCAL
)  # between rail and line at rest: another unit, or no sensor; nothing to be learned
SWINGS, SWAPPED = (
    2 * MEGAPASCAL,
    3.0,
)  # of the rail pressure in an event, and more than the line's by this factor


def implausible(window: Window, pressure_scale: float) -> Objection | None:
    """What shows before any fit that the pressures of an event are not those of rail and line; p_0 [Pa].

    The rail hardly moves when the needle opens, the line does: where it is the other way round, they are swapped.
    """
    before, rail = slice(0, max(window.opening, 1)), window.inputs[:, 0]
    if abs(median(window.output[before] - rail[before])) * pressure_scale > IMPLAUSIBLE:
        return Objection(Reason.PRESSURE_OFFSET, Phase.STANDSTILL)
    rail_swing = float(np.std(rail))
    if rail_swing * pressure_scale > SWINGS and rail_swing > SWAPPED * float(np.std(window.output)):
        return Objection(Reason.CONTRADICTED)
    return None


class Learner(Tracker):
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    _reader: EventReader
    _held_rail: HeldRail
    _freezer: Freezer
    _mistrust: Mistrust
    _checkpoint: Checkpoint
    _lag_doubt: LagDoubt
    _slowed: SlowedSensor
    _lift_lag: LiftLagSearch
    _energizing: Energizing
    _pressure_gains: PressureGains
    _passed_with: NDArray[np.float64]

    def __init__(
        self,
        constants: Constants,
        knowledge: Knowledge,
        scalars: Scalars = SCALARS,
        healthy: Healthy = NOT_FITTED,
    ) -> None:
        """healthy: what the model leaves unexplained of a healthy injector."""
        self._constants = constants
        self._healthy = healthy
        self._scalars = scalars
        self._scale = constants.coefficients.pressure_scale
        self._wide, self._drift = scalars.prior(self._scale), scalars.drift(self._scale)
        self._belief = knowledge.belief
        self._theta = knowledge.in_force
        self._active = knowledge.active
        self._kept = GatedBelief(self._belief, scalars.gate, self._active)
        self._noise = knowledge.noise
        self._events = knowledge.events
        self._statistics = knowledge.statistics
        self._learned_at = knowledge.learned_at
        colour = knowledge.colour_at(constants.interval)
        self._reader = EventReader(constants.interval, self._scale, scalars, colour, healthy)
        self._offset_since = OffsetSince()
        self._held_rail = HeldRail()
        self._gains_for = lru_cache(maxsize=2)(gain_schedule)  # most events find the same line, noise and lag
        self._schedule = self._gains(self._theta)
        self._previous: Rehearsed | None = None
        self._freezer = Freezer()
        self._mistrust = Mistrust()
        self._checkpoint = Checkpoint(scalars.width, self._reader)
        self._lag_doubt = LagDoubt(scalars.width)
        self._slowed = SlowedSensor()
        self._lift_lag = LiftLagSearch()
        self._energizing = Energizing(constants.interval, self._wide)
        self._pressure_gains = PressureGains()
        self._passed_with = self._theta.copy()
        self.recall(knowledge.memory_at(constants.interval))

    @property
    def schedule(self) -> GainSchedule:
        """Gains for the noise levels and the sensor lag in use."""
        return self._schedule

    @property
    def phi(self) -> StructuredPhi:
        """x^ carries the network of theta, as x~ does."""
        return StructuredPhi()

    @property
    def belief(self) -> Belief:
        """What is believed after the last event."""
        return self._belief

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Update the belief from one event; decide whether its estimate is adopted in place of `in_force` (m,).

        constants: during the event; None: as they were.
        """
        outcome = self._learn(window, standstill, in_force, constants or self._constants)
        passed = not outcome.objections
        self._checkpoint.after(self._believed_now, self._reader, passed)
        if passed:
            self._passed_with = outcome.knowledge.in_force
        else:
            self._forget(Cause.NOT_PASSED)
        memory = Memory(self._constants.interval, self.memory())
        outcome = replace(outcome, knowledge=replace(outcome.knowledge, memory=memory))
        if outcome.adoption is Adoption.ADOPTED:
            return outcome
        return replace(outcome, schedule=self._gains(outcome.knowledge.in_force))

    def _learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants
    ) -> Outcome:
        self._constants = constants
        if standstill.noise is not None:
            self._hear(standstill.noise)
        self._schedule = self._gains(self._theta)
        objection = implausible(window, self._scale)
        if self._held_rail.is_held_after(window, standstill, constants.rail_every):
            objection = Objection(Reason.INPUT_FROZEN)
        if objection is not None:
            return replace(self._outcome(Adoption.FAILED, window, in_force), objections=(objection,))
        try:
            event, believed = self._explained(window, standstill)
            if event is None:
                return self._outcome(Adoption.FAILED, window, in_force)
            recorded = self._without_gains(window)
            window = self._energizing.undone(recorded)
            lag = lag_score(event.window, believed.setting, event.fit, event.cost, self._wide, self._scalars)
            carried = GatedBelief(event.fit.prior, self._scalars.gate, self._active).carried(in_force)
            self._take_in(event)
        except np.linalg.LinAlgError:
            return self._outcome(Adoption.FAILED, window, in_force)
        is_clipped = self._is_clipped_after(event, window, believed)
        is_disturbed = self._is_disturbed_after(event, recorded, believed)
        again = self._resimulated(event.window, carried)
        self._lag_doubt.take_in(None if lag is None else lateness_of(lag, again.run))
        doubts = self._doubts(event)
        rehearsed = self._rehearsed(event.window)
        better = is_better(rehearsed, self._theta, in_force, self._reader.colour, self._scalars)
        if self._freezer.is_frozen_after(self._statistics):
            return _because(self._frozen(event.window, in_force), is_clipped, is_disturbed)
        adoption = Adoption.ADOPTED if better or believed.again else Adoption.REJECTED
        outcome = self._outcome(adoption, event.window, in_force, doubts)
        outcome = _because(outcome, is_clipped, is_disturbed)
        told = self._lift_lag.told(outcome.objections, partial(self._lift_lag_in, event, believed))
        outcome = replace(outcome, objections=told)
        because = self._mistrust.after(outcome.objections)
        outcome = replace(outcome, objections=self._mistrust.told(outcome.objections))
        if because is not None:
            carried_on = self._carried_after(because, rehearsed)
            reasons = outcome.objections or (because,)
            knowledge = replace(outcome.knowledge, in_force=carried_on.copy())
            return replace(outcome, adoption=Adoption.SET_ASIDE, knowledge=knowledge, objections=reasons)
        if self._checkpoint.is_known and any(each.reason in UNEXPLAINED for each in outcome.objections):
            as_before = replace(outcome.knowledge, in_force=in_force.copy())
            outcome = replace(outcome, adoption=Adoption.REJECTED, knowledge=as_before)
        again = replace(again, systematic=math.hypot(again.systematic, self._lag_doubt.volume_share))
        masked = int(event.window.masked.sum()) - int(window.masked.sum())
        loudest = self._reader.loudest(event.window, believed)
        taken = outcome.knowledge.in_force
        known = known_flow(again, taken, self._gated.carried(taken), self._learned_at[-1])
        return replace(outcome, resimulated=again, outliers=masked, loudest=loudest, known=known)

    def _hear(self, noise: NoiseLevels) -> None:
        """Noise levels from an event on: what an event was by others says nothing by these."""
        before = self._noise
        if any(
            abs(math.log(now / then)) > math.log(OTHER_NOISE)
            for now, then in (
                (noise.rail_pressure, before.rail_pressure),
                (noise.line_pressure, before.line_pressure),
            )
        ):
            self._forget(Cause.OTHER_NOISE)
        self._noise = noise

    def _explained(self, window: Window, standstill: Standstill) -> tuple[Explained | None, Believed]:
        """An event as recorded, as far as it is understood, and by what; standstill: when it ended.

        Raises LinAlgError.
        """
        offset = self._offset_since.after(standstill)
        if self._checkpoint.is_worth_trying:
            found = self._explained_before(window, standstill)
            if found is not None:
                return found
        believed = self._believed(window, standstill, offset)
        return self._reader.explained(self._undone(window), believed), believed

    def _explained_before(self, window: Window, standstill: Standstill) -> tuple[Explained, Believed] | None:
        """An event explained by what was believed before others did not pass: that is believed again.

        None, with nothing changed, where it is not. What stood still before it does not count: it is of the fault.
        """
        now, schedule, reader = self._believed_now, self._schedule, self._reader
        self._believed_now = self._checkpoint.believed
        self._schedule, self._reader = self._gains(self._theta), self._checkpoint.reader(reader)
        try:
            believed = self._believed(window, standstill, None)._replace(again=True)
            event = self._reader.explained(self._undone(window), believed)
            if event is not None and self._is_as_believed(event):
                self._forget(Cause.PASSED)
                return event, believed
        except np.linalg.LinAlgError:
            pass
        self._believed_now, self._schedule, self._reader = now, schedule, reader
        return None

    @property
    def _believed_now(self) -> BelievedSoFar:
        learned = self._belief, self._theta, self._active, self._events
        return BelievedSoFar(*learned, self._pressure_gains, self._statistics)

    @_believed_now.setter
    def _believed_now(self, believed: BelievedSoFar) -> None:
        self._belief, self._theta, self._active, self._events = believed[:4]
        self._pressure_gains, self._statistics = believed[4:]

    def _without_gains(self, window: Window) -> Window:
        return window._replace(output=self._pressure_gains.undone(window.output))

    def _undone(self, window: Window) -> Window:
        """An event as recorded, without what is known to disturb the line pressure."""
        return self._energizing.undone(self._without_gains(window))

    def _is_as_believed(self, event: Explained) -> bool:
        """Whether an event, with those before the trouble, says nothing against what it was explained by."""
        theta = event.fit.linearisation.theta
        found = self._contradictions(pooled(self._statistics, self._statistics_of(event)), theta)
        return not (event.fit.contradicts or found or is_worn_beyond_limits(theta, self._scalars))

    def _statistics_of(self, event: Explained) -> PhaseStatistics:
        innovations = Innovations(event.fit.innovations, event.cost.sigma)
        return event_statistics(event.window, innovations, self._constants.interval, self._healthy)

    def _believed(self, window: Window, standstill: Standstill, offset: float | None) -> Believed:
        """What is known when an event comes. Raises LinAlgError when singular.

        standstill: when it ended; offset: line over rail pressure at rest since the event before [p_0].
        """
        prior = self._prior(standstill)
        if offset is not None:
            offset = self._pressure_gains.undone_offset(offset, float(window.inputs[:, 0].mean()))
        return Believed(
            self._setting(),
            Sigmas(self._schedule.innovation_sigma, self._noise.line_pressure / self._scale),
            offset,
            self._theta,
            self._active,
            prior,
            is_first=self._events == 0,
            lasts=self._mistrust.lasts,
        )

    def _prior(self, standstill: Standstill) -> Belief:
        """The belief before this event; the first one takes its offset from the standstill."""
        if self._events > 0:
            return self._pressure_gains.rescaled(self._belief.drifted(self._drift))
        if standstill.samples < STANDSTILL_ENOUGH:
            return self._belief
        mean = self._belief.mean.copy()
        mean[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
        self._theta = self._theta.copy()
        self._theta[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
        return replace(self._belief, mean=mean)

    def _take_in(self, event: Explained) -> None:
        """The fitted event into statistics and belief, there tempered where its innovations are coloured."""
        if event.is_louder:
            self._forget(Cause.STEEP_NOISE)
        statistics = self._statistics_of(event)
        here = event.fit.linearisation
        temper = self._reader.temper(statistics, self._noise.rail_pressure / self._scale)
        temper = max(temper / event.cost.temper, 1.0)
        self._belief = event.fit.prior.updated(here.information / temper, here.vector / temper)
        self._theta, self._active = here.theta, event.fit.active
        self._reader.colour = event.colour
        self._events += 1
        self._statistics = pooled(self._statistics, statistics)
        rail_pressure = float(event.window.inputs[:, 0].mean())
        found = float(self._theta[Parameter.LINE_PRESSURE_OFFSET])
        self._pressure_gains.add(self._pressure_gains.as_recorded(found, rail_pressure), rail_pressure)

    def _is_clipped_after(self, event: Explained, window: Window, believed: Believed) -> bool:
        """Whether the line pressure's range ends in an event; window: as it was before.

        What was said of the events in which that showed was said of their clipped samples.
        """
        is_clipped = self._reader.is_clipped_after(event, believed)
        is_known, is_new = self._reader.is_range_ending_in(window, believed)
        if is_new:
            self._forget(Cause.RANGE_ENDS)
        return is_clipped or is_known

    def _is_disturbed_after(self, event: Explained, recorded: Window, believed: Believed) -> bool:
        """Whether energizing the coil shows in an event that had all of it.

        Once it is taken out, what was learned and said so far was of other line pressures than those that come.
        """
        was_known = self._energizing.is_known
        whole = event.window._replace(output=recorded.output)
        cost_of = partial(self._reader.cost_of, believed=believed._replace(offset=None))
        is_disturbed = self._energizing.is_disturbing(whole, event.fit, event.cost.sigma, cost_of)
        if self._energizing.is_known and not was_known:
            self._forget(Cause.COIL)
        return is_disturbed

    def _resimulated(self, window: Window, carried: NDArray[np.float64]) -> Resimulated:
        """An event with what was learned from it; carried (m, m): covariance of the theta in force before."""
        strange = self._strangeness(window)
        more = self._energizing.covariance
        now = self._gated.carried(self._theta) + more
        event = resimulated(
            window, self._setting(), self._noise, self._theta, now, carried + more, self._scalars
        )
        shares = self._healthy.mass_share, UNSEEN * strange, self._pressure_gains.flow_share
        return replace(event, systematic=math.hypot(*shares))

    @property
    def _gated(self) -> GatedBelief:
        """The belief as the estimate has it."""
        if self._kept.belief is not self._belief or self._kept.active != self._active:
            self._kept = GatedBelief(self._belief, self._scalars.gate, self._active)
        return self._kept

    def _strangeness(self, window: Window) -> float:
        """How far an event's operating point was from those learned at, of which it is one from now on."""
        point = operating_point(window, self._constants.interval)
        strange = unfamiliarity(point, self._learned_at)
        self._learned_at = remembered(self._learned_at, point)
        return strange

    def _doubts(self, event: Explained) -> list[Reason]:
        """What an event brings up beside its innovations."""
        doubts = []
        before, now = sensor_lag(event.fit.prior.mean), sensor_lag(self._theta)
        if self._slowed.after(before, now, event.fit.contradicts):
            doubts.append(Reason.SENSOR_LAG)
        if self._lag_doubt.is_relevant:
            doubts.append(Reason.TIME_BASE)
        if event.fit.contradicts:
            doubts.append(Reason.SUDDEN_CHANGE)
            self._forget(Cause.SUDDEN_CHANGE)
        return doubts

    def _rehearsed(self, window: Window) -> Sequence[Rehearsed]:
        """This event, and the one before, to be run open loop."""
        offset = float(self._theta[Parameter.LINE_PRESSURE_OFFSET])
        before, now = self._previous, Rehearsed(window, self._setting(), offset)
        self._previous = now
        return [now] if before is None else [before, now]

    def _carried_after(self, because: Objection, events: Sequence[Rehearsed]) -> Theta:
        """What is carried (m,) where events are not explained: of all that once explained some what is best at them.

        What was learned from them explains nothing. The nominal model where the scale is not known: another one
        explains the pressures as well, with other masses.
        """
        nominal = np.zeros_like(self._theta)
        if because.reason is Reason.AMBIGUOUS_SCALE:
            return nominal
        candidates = [nominal, self._passed_with]
        if self._checkpoint.is_known:
            candidates.append(self._checkpoint.believed.theta)
        return best_explaining(events, candidates, self._reader.colour, self._scalars)

    def _lift_lag_in(self, event: Explained, believed: Believed, expected: float) -> LiftLag:
        """The lag of the lift that explains an event best; expected: [s]."""
        cost_of = partial(self._reader.cost_of, believed=believed)
        return lift_lag_of(event.window, self._setting(), cost_of, self._scalars, expected)

    def _frozen(self, window: Window, in_force: NDArray[np.float64]) -> Outcome:
        """Fall back to phi = 0 and forget: what was learned belongs to another line. No event is valid meanwhile."""
        outcome = self._outcome(Adoption.FROZEN, window, in_force)
        found = outcome.objections or (Objection(Reason.MODEL_INADEQUATE, Phase.STANDSTILL),)
        self._forget(Cause.FROZEN)
        knowledge = replace(
            no_knowledge(self._noise, self._scale, self._scalars),
            events=outcome.knowledge.events,
            statistics=self._statistics,
            colour=self._reader.colour,
        )
        return replace(outcome, knowledge=knowledge, objections=found)

    def _forget(self, cause: Cause) -> None:
        """What no longer holds, by the table."""
        parts = FORGOTTEN[cause]
        if Forgotten.LEARNED in parts:
            fresh = no_knowledge(self._noise, self._scale, self._scalars)
            self._belief, self._theta, self._active = fresh.belief, fresh.in_force, fresh.active
            self._events = 0
        if Forgotten.CERTAINTY in parts:
            self._belief = self._belief.widened(self._wide)
        if Forgotten.OPERATING_POINTS in parts:
            self._learned_at = ()
        if Forgotten.STATISTICS in parts:
            self._statistics = no_statistics()
        if Forgotten.STATISTICS_OF_INJECTIONS in parts:
            self._statistics = of_standstill(self._statistics)
        if Forgotten.MISTRUST in parts:
            self._mistrust = Mistrust()
        if Forgotten.FREEZING in parts:
            self._freezer = Freezer()
        if Forgotten.SLOWED in parts:
            self._slowed = SlowedSensor()
        if Forgotten.LAST_EVENT in parts:
            self._previous = None
        if Forgotten.CHECKPOINT in parts:
            self._checkpoint = Checkpoint(self._scalars.width, self._reader)
        self._reader.forget(cause)

    def _outcome(
        self,
        adoption: Adoption,
        window: Window,
        in_force: NDArray[np.float64],
        doubts: Sequence[Reason] = (),
    ) -> Outcome:
        """What to say of an event; `in_force` (m,) was carried during it, `doubts` arose while it was fitted."""
        return Outcome(
            adoption=adoption,
            knowledge=Knowledge(
                belief=self._belief,
                in_force=(self._theta if adoption is Adoption.ADOPTED else in_force).copy(),
                noise=self._noise,
                active=self._active,
                events=self._events,
                statistics=self._statistics,
                colour=self._reader.colour,
                learned_at=self._learned_at,
                scalars=self._scalars,
            ),
            schedule=self._schedule,
            objections=self._objections(adoption, window, doubts),
            estimate=self._theta.copy(),
            covariance=self._gated.covariance
            + np.diag(self._pressure_gains.wear_variance(self._scalars.width))
            + np.diag(self._lag_doubt.variance),
        )

    def _objections(
        self, adoption: Adoption, window: Window, doubts: Sequence[Reason]
    ) -> tuple[Objection, ...]:
        if adoption is Adoption.FAILED:
            return (Objection(Reason.NOT_LEARNED),)
        result = self._contradictions(self._statistics, self._theta)
        if self._pressure_gains.is_too_large and Objection(Reason.PRESSURE_OFFSET) not in result:
            result.insert(0, Objection(Reason.PRESSURE_OFFSET))
        if is_worn_beyond_limits(self._theta, self._scalars):
            result.append(Objection(Reason.MODEL_INADEQUATE, Phase.OPEN))
        result.extend(Objection(reason) for reason in doubts)
        if looks_like_inertance(self._open_nozzle_change(window), float(self._theta[Parameter.BULK_MODULUS])):
            result.append(Objection(Reason.AMBIGUOUS_SCALE))
        return tuple(result)

    def _contradictions(self, statistics: PhaseStatistics, theta: Theta) -> list[Objection]:
        """What statistics, and the sensor as it is in theta (m,), say against the model."""
        offset = float(theta[Parameter.LINE_PRESSURE_OFFSET]) * self._scale
        return objections(statistics, offset, sensor_lag(theta), self._healthy)

    def _open_nozzle_change(self, window: Window) -> float:
        """N_H with the needle as open as it was in this event, at the steady sac pressure of the rail pressure."""
        widest = int(np.argmax(window.inputs[:, 1]))
        u = window.inputs[widest]
        return nozzle_change(self._theta, np.array([u[0], 0.0, 0.9 * u[0]]), u)[0]

    def _gains(self, theta: Theta) -> GainSchedule:
        """Those of x~ with theta (m,): with others a line with waves may swing ever higher."""
        learned = learned_of(theta, self._constants.coefficients, self._scalars)
        sensor, rate = self._constants.sensor, 1.0 / self._constants.interval
        lag = sensor.lag + learned.lag
        every = self._constants.rail_every
        return self._gains_for(learned.coefficients, self._noise, rate, lag, sensor.fraction, every)

    def _setting(self) -> Setting:
        return setting_of(self._constants, self._schedule)


def setting_of(constants: Constants, schedule: GainSchedule) -> Setting:
    """How x~ is followed over an event."""
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


def _because(outcome: Outcome, is_clipped: bool, is_disturbed: bool) -> Outcome:
    """An outcome with what is known of the line pressure as the first objection: that is why there are others."""
    if is_disturbed:  # though all else may look right
        reason = Reason.CONTRADICTED
    elif is_clipped and outcome.objections:
        reason = Reason.INPUT_CLIPPED
    else:
        return outcome
    return replace(outcome, objections=(Objection(reason), *outcome.objections))
