"""The explanation of an event by all kinds that it may be, and the account of change after it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.phases import phases_of
from observer_rt.engine.estimation.belief import best_subset
from observer_rt.engine.estimation.parameters import LAWLESS, NEEDLE_LAW, SCALARS, Parameter
from observer_rt.engine.estimation.phases import AFTERGLOW, EDGE
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scales import shrink
from observer_rt.engine.learning import noise
from observer_rt.engine.learning.adequacy import pooled, tempering
from observer_rt.engine.learning.event import (
    ClosedEvent,
    EventReader,
    EventReading,
    RestingPressure,
    with_smooth_rail,
)
from observer_rt.engine.learning.explanations import FIRST_STEPS, LATE_SENSOR, STARTED, Explanation, OfferedKinds
from observer_rt.engine.learning.fit import EventFitter, Fit
from observer_rt.engine.learning.kinds import FILED, NEEDLE_CHANGED, STATED, UNLIKE_BEFORE, Mode, is_alike
from observer_rt.engine.learning.knowledge import Account, LearnedInjector, LearningState
from observer_rt.engine.learning.mass import EventPoint, opening_points, with_point
from observer_rt.engine.learning.noise import Colour, RestingNoise, Sigmas, without_stretches
from observer_rt.engine.learning.run import EventCost, EventRun
from observer_rt.foundation.units import MEGAPASCAL, Z_95

FIRST_FITS = 3  # of a first event by commands, from the starts that cost least; more end where these do; M
AGAINST_RIVAL = 5.0  # nats at most that one event counts against a rival: a needle unlike the model's misleads; M
LIVE = 5e-3  # weight from which on a hypothesis is carried on; M
RIVAL_LIVES = 1e-7  # .. where it explains all events by other elements: it takes some to tell a lag from a bounce; M
MOVED = 0.005 * MEGAPASCAL  # of offset or gain: beyond it an event is linearised anew
_SENSOR = (int(Parameter.LINE_PRESSURE_OFFSET), int(Parameter.LINE_PRESSURE_GAIN))


class Noise(NamedTuple):
    """Statistics of the innovations at rest, and their colour."""

    at_rest: RestingNoise
    colour: Colour | None


Continued = tuple[Explanation, LearnedInjector]
"""An explanation of an event, and the belief after it."""


@dataclass(frozen=True, eq=False)
class BeliefUpdate:
    """Update of beliefs by one event; state: before it, point: of the event."""

    reader: EventReader
    state: LearningState
    point: EventPoint
    _noises: dict[tuple[int, int], Noise] = field(default_factory=dict)

    def after(self, explanation: Explanation) -> LearnedInjector:
        """The belief after an explanation. Raises numpy.linalg.LinAlgError when singular."""
        learned = explanation.before
        if explanation.is_good:
            return self._learned(explanation)
        if not learned.is_prior:
            return replace(learned, belief=explanation.prior)
        if explanation.kind.mode is Mode.PASSING:  # else a wrong ring-down is taken for the colour of the noise
            return learned
        noise = self._noise(explanation)
        return replace(learned, at_rest=noise.at_rest, colour=noise.colour)

    def _learned(self, explanation: Explanation) -> LearnedInjector:
        before, cost, limits = explanation.before, explanation.cost, self.reader.limits
        held, reading, fit = explanation.held, explanation.reading, explanation.fit
        statistics = self.reader.healthy.relative(reading.leaves(explanation.run))
        temper = max(tempering(statistics) / reading.cost.temper, 1.0)
        information = cost.information / temper
        belief = held.prior.updated(information, cost.vector / temper)
        likely, active = shrink(belief), before.active if fit is None else fit.active
        gate = limits.gate_of_lag(limits.least_lag)
        theta, active = best_subset(likely.mean, likely.covariance, gate, active, carried=True)
        noise = self._noise(explanation)
        considered = held.considered(belief, information)
        limits.refuse_far(considered.mean)
        _ = considered.inverse  # or it raises: the next event needs it
        return LearnedInjector(
            belief=considered,
            theta=np.clip(theta, limits.lowest, limits.highest),
            statistics=pooled(before.statistics, statistics),
            active=active,
            is_prior=False,
            colour=noise.colour,
            at_rest=noise.at_rest,
            learned_at=with_point(() if explanation.kind in UNLIKE_BEFORE else before.learned_at, self.point),
        )

    def _noise(self, explanation: Explanation) -> Noise:
        """Noise by the belief before an explanation, and by its event; computed once for each reading."""
        learned, reading = explanation.before, explanation.reading
        key = id(learned.at_rest), id(reading)
        if key not in self._noises:
            self._noises[key] = noise_after(learned, reading, explanation.run, self.reader)
        return self._noises[key]


def noise_after(learned: LearnedInjector, reading: EventReading, run: EventRun, reader: EventReader) -> Noise:
    """Noise by a belief, and by the innovations of a run of an event at rest."""
    stretches = noise.resting_segments(reading.window, reader.burn_in, reader.resting)
    at_rest = learned.at_rest.after([run.unfiltered[each] for each in stretches], reader.interval)
    return Noise(at_rest, at_rest.colour(learned.colour, reader.interval, reading.white_sigma))


def is_late(active: frozenset[int]) -> bool:
    """Whether a lag of the line sensor is among the gated columns in use; delays of the needle look alike."""
    return int(Parameter.SENSOR_LAG) in active


def has_lag_for_bounce(rival: LearnedInjector, learned: LearnedInjector) -> bool:
    """Whether a rival has a lag of the line sensor in place of a bounce of the needle."""
    only_rival, only_learned = rival.active - learned.active, learned.active - rival.active
    return Parameter.SENSOR_LAG in only_rival and Parameter.LANDING_BOUNCE in only_learned


def account_after(before: Account, continued: Sequence[Continued]) -> tuple[Explanation, Account]:
    """The explanation to carry, and the account after an event; continued: the likeliest first.

    Alike beliefs are one, in several modes. That with most support in one mode goes on by its first good explanation.
    A rival stays while it has a lag for a bounce, though it explains no more: a needle unlike the model's misleads.
    """

    def is_one(first: Continued, second: Continued) -> bool:
        return is_alike(first[1].belief, second[1].belief) and noise.is_same(first[1].colour, second[1].colour)

    def support(of: Continued) -> float:
        return sum(each[0].weight for each in continued if each[0].kind.mode is of[0].kind.mode and is_one(of, each))

    best = max(continued, key=support)
    kept = [each for each in continued if is_one(best, each)]
    lead, learned = next((each for each in kept if each[0].is_good), kept[0])
    total, modes = sum(each.weight for each, _ in kept), dict[Mode, float]()
    others = [each for each in continued if is_late(each[1].active) is not is_late(learned.active)]
    rival = before.rival
    if rival is not None and not (rival.outlasts and has_lag_for_bounce(rival.learned, learned)):
        rival = None
    if others and lead.reading.window.needle is not None:
        odds = math.log(sum(each[0].weight for each in others if is_one(others[0], each)) / total)
        least = (before.rival.log_odds if before.rival else 0.0) - AGAINST_RIVAL
        rival = Account(others[0][1], log_odds=max(odds, least), outlasts=before.rival is not None)
    for explanation, _ in kept:
        mode = explanation.kind.mode
        modes[mode] = modes.get(mode, 0.0) + explanation.weight / total
    drift = next((each.drift for each, _ in kept if each.drift is not None), None)
    return lead, Account(learned, modes, None if drift is None else drift.after(learned.belief), rival)


class ExplainedEvent(NamedTuple):
    """An event with its explanations.

    state: before it, but for its own rest; recorded: its window; unmasked: the window without the coil's pulse;
    explanations: the likeliest first; lead: the explanation that is carried; account: after the event.
    """

    state: LearningState
    recorded: Window
    unmasked: Window
    point: EventPoint
    explanations: list[Continued]
    lead: Explanation
    account: Account

    @property
    def window(self) -> Window:
        """Window of the leading explanation, without the coil's pulse, stretches that are off masked."""
        return self.lead.reading.window

    @property
    def fault_weight(self) -> float:
        """Probability that the event is at fault, or the model inadequate."""
        return sum(explanation.weight for explanation, _ in self.explanations if not explanation.is_good)


def explain(state: LearningState, event: ClosedEvent, offset: float | None, reader: EventReader) -> ExplainedEvent:
    """Explain an event; offset: line over rail at rest before it [p_0]. Raises LinAlgError if nothing is finite."""
    window = with_smooth_rail(state.energizing.current.undone(event.window), event.constants)
    readings = _EventReadings(state, event, offset, reader)
    readings.weigh(state.account, window)
    for rival in readings.rivals:
        readings.weigh(rival, window)
    if state.learned.is_prior:
        readings.weigh_coloured(state.learned, window)
    readings.weigh_masked()
    explanations = readings.explanations()
    lead = next((i for i, each in enumerate(explanations) if each.is_good), None)
    if lead is not None:  # it is carried, and run again
        explanations[lead] = explanations[lead].fitted(reader)
    point = opening_points(window, reader.interval)[-1]
    update = BeliefUpdate(reader, state, point)
    continued = [(each, update.after(each)) for each in explanations]
    carried, account = account_after(state.account, continued)
    gain, furthest = float(account.learned.theta[_SENSOR[1]]), Z_95 * reader.calibration.gain  # as far as is stated
    at_rest = carried.reading.resting.point(point.rail_pressure)
    state = replace(state, sensor_slope=state.sensor_slope.after(at_rest, min(max(gain, -furthest), furthest)))
    return ExplainedEvent(state, event.window, window, point, continued, carried, account)


class _EventReadings:
    """Readings of an event, with all of its samples or without some, and the weights of all that explains it."""

    def __init__(self, state: LearningState, event: ClosedEvent, offset: float | None, reader: EventReader) -> None:
        self._state, self._event, self._offset, self._reader = state, event, offset, reader
        window = event.window
        self._phases = phases_of(window, round(EDGE / reader.interval), round(AFTERGLOW / reader.interval))
        self._best, self._weighed = -math.inf, list[Explanation]()
        self.rivals = [state.account.rival] if state.account.rival else []

    def weigh(self, account: Account, window: Window, off: float = 0.0) -> None:
        """Explain a window, if finite; off: nats of samples left out. Raises LinAlgError when singular."""
        reading = self._read(account.learned, window, off)
        if np.isfinite(reading.first.value):
            kinds = OfferedKinds(account, reading, self._reader)
            kinds.refine(self._best)
            self._best = max(self._best, kinds.best)
            self._weighed += kinds.explanations(self._best)

    def weigh_coloured(self, learned: LearnedInjector, window: Window) -> None:
        """Explain the event with the colour that its innovations at rest show, if none was known before."""
        fitted = (each for each in self._weighed if each.fit is not None)
        likeliest = max(fitted, key=lambda each: each.log_weight, default=None)
        if likeliest is None or learned.colour is not None:
            return
        run = likeliest.run
        colour = noise_after(learned, likeliest.reading, run, self._reader).colour
        if colour is not None:
            learned = replace(learned, colour=colour, theta=run.theta)
            self.weigh(replace(self._state.account, learned=learned), window)

    def weigh_masked(self) -> None:
        """Explain the event without stretches that stand out of its likeliest explanation."""
        best = max(self._weighed, key=lambda each: each.log_weight, default=None)
        if best is None:
            return
        noise = self._state.noise.line_pressure / self._reader.pressure_scale
        sigmas = Sigmas(best.reading.cost.sigma, noise)
        masked = without_stretches(best.reading.window, best.run.innovations, sigmas, self._reader.burn_in)
        if masked is not None:
            whose = next((each for each in self.rivals if each.learned is best.before), self._state.account)
            self.weigh(replace(whose, learned=best.before), masked.window, masked.nats)

    def explanations(self) -> list[Explanation]:
        """Explanations of sufficient weight, the likeliest first. Raises numpy.linalg.LinAlgError without any."""
        if not self._weighed:
            raise np.linalg.LinAlgError("no finite fit")
        logs = np.array([each.log_weight for each in self._weighed])
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        order = np.argsort(-weights, kind="stable")
        active = self._weighed[order[0]].before.active
        lives = [LIVE if each.before.active == active else RIVAL_LIVES for each in self._weighed]
        return [replace(self._weighed[i], weight=float(weights[i])) for i in order if weights[i] >= lives[i]]

    def _read(self, learned: LearnedInjector, window: Window, off: float) -> EventReading:
        state, event, reader = self._state, self._event, self._reader
        setting, white_sigma = reader.setting_at(learned.theta, state.noise, event.constants)
        temper, shape = state.overdispersion.factor, reader.healthy.shape
        cost = EventCost(window, setting, white_sigma, reader.burn_in, None, self._offset, temper, shape)
        cost = cost.whitened_by(learned.colour)
        first, resting = self._run(learned, cost)
        return EventReading(learned, cost, first, white_sigma, self._phases, resting, off)

    def _first(self, learned: LearnedInjector, cost: EventCost) -> EventRun:
        """The run at the belief, or the best of several fits in the first event of a needle that answers commands.

        These have no flow laws, which would make up for a needle and a line far from theirs. The best with a late
        line sensor, which looks like delays and a bounce of the needle, becomes a rival.
        """
        first = cost.linearised(learned.theta)
        if cost.window.needle is None or not learned.is_prior or learned.active:
            return first
        prior, fits = learned.belief, list[Fit]()
        fitter = EventFitter(replace(cost, columns=LAWLESS), learned.active, self._reader.limits)
        filed = prior.narrowed(STATED, FILED)
        for beliefs, moves in (((filed, prior), STARTED[NEEDLE_CHANGED]), ((prior,), LATE_SENSOR)):
            starts = sorted(map(fitter.cost.linearised, learned.theta + moves), key=lambda run: run.value)
            fits += [fitter.fit(*each, FIRST_STEPS) for each in product(starts[:FIRST_FITS], beliefs)]
        fits.sort(key=lambda fit: fit.run.value + 0.5 * prior.distance(fit.run.theta))
        late, others = ([fit for fit in fits if is_late(fit.active) is wanted] for wanted in (True, False))
        sought, begun = [*NEEDLE_LAW.columns.tolist(), *STATED], []
        for fit in (*others[:1], *late[:1]):
            begun.append(learned.theta.copy())
            begun[-1][sought] = fit.run.theta[sought]
        self.rivals = [Account(replace(learned, theta=theta, active=late[0].active)) for theta in begun[1:]]
        return cost.linearised(begun[0])

    def _run(self, learned: LearnedInjector, cost: EventCost) -> tuple[EventRun, RestingPressure]:
        """Run an event at the belief, with offset and gain by its rest where they differ from the belief's."""
        first = self._first(learned, cost)
        resting = RestingPressure.of(cost, first)
        move = resting.held(learned.belief).prior.mean - learned.belief.mean
        move[list(SCALARS.gate.columns)] = 0.0
        if np.abs(move[list(_SENSOR)]).max() * self._reader.pressure_scale < MOVED:
            return first, resting
        first = cost.linearised(first.theta + move, first)
        return first, RestingPressure.of(cost, first)
