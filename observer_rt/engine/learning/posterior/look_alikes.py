"""Look-alikes of wear that theta cannot hold: each is tested by itself, whatever the posterior says.

The coil, sensors whose gains differ, an inertance taken for wear.
What they are followed by moves only while events are explained.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.engine.estimation.phases import Phase, no_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Parameter, Theta, learned_of, sensor_lag
from observer_rt.engine.learning import adequacy
from observer_rt.engine.learning.account import Account, LearnedInjector
from observer_rt.engine.learning.disturbances.colour import RestingNoise, resting_segments
from observer_rt.engine.learning.indicators import nozzle_change
from observer_rt.engine.learning.knowledge import LearningState
from observer_rt.engine.learning.posterior.event import ExplainedEvent
from observer_rt.engine.learning.posterior.explaining import Explanation
from observer_rt.engine.learning.posterior.reader import EventReader
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.units import Z_95
from observer_rt.model.effective import LAG_UNIT

UNEXPLAINED = (Reason.MODEL_INADEQUATE, Reason.CONTRADICTED)
# s, of the lift against the pressures, late or early, that x^ may do without: 1 % of a mass, some tenths of it.
LATEST_LIFT, EARLIEST_LIFT = 6e-6, -25e-6


@dataclass(frozen=True, eq=False)
class LookAlikes:
    """Findings of one event beside its posterior.

    state: after it, but for the account; objections: whatever the posterior says; begins_anew: all that was believed
    was of other line pressures than those that come.
    """

    state: LearningState
    objections: tuple[adequacy.Objection, ...]
    begins_anew: bool


def look_alikes_in(explained: ExplainedEvent, reader: EventReader) -> LookAlikes:
    """Look-alikes in an event that was explained."""
    explanation, state = explained.lead, explained.state
    if not explanation.is_good or explanation.fit is None:
        return LookAlikes(state, (), begins_anew=False)
    if explained.fault_weight < 0.5:
        state = _followed(state, explained, explanation, reader)
    state, is_disturbed, begins_anew = _with_coil(state, explained, explanation, reader)
    objections = _objections(state, explained.window, explained.account.learned, is_disturbed, reader)
    return LookAlikes(state, objections, begins_anew)


def named(
    against: Sequence[adequacy.Objection], explained: ExplainedEvent, reader: EventReader
) -> tuple[adequacy.Objection, ...]:
    """Objections to an event, with phases."""
    return tuple(_with_phase(each, explained, reader) for each in against)


def _with_phase(objection: adequacy.Objection, explained: ExplainedEvent, reader: EventReader) -> adequacy.Objection:
    """An objection to an event that is not explained, with the phase in which that shows."""
    if objection.reason not in UNEXPLAINED or objection.phase is not None:
        return objection
    left = reader.healthy.relative(explained.lead.reading.leaves(explained.lead.run))
    return replace(objection, phase=adequacy.inadequate_phase(left))


def _followed(
    state: LearningState, explained: ExplainedEvent, explanation: Explanation, reader: EventReader
) -> LearningState:
    """Adds an explained event to the state that is followed."""
    sigma, first = explanation.reading.white_sigma, reader.burn_in
    segments = resting_segments(explained.window, first, reader.resting)
    overdispersion = state.overdispersion
    if explanation.score_as_believed is not None:
        overdispersion = overdispersion.after(explanation.score_as_believed)
    return replace(
        state,
        events=state.events + 1,
        overdispersion=overdispersion,
        jitter=state.jitter.after(explained.window, explanation.run.unfiltered, sigma, first),
        slow_rail=state.slow_rail.after([explained.window.inputs[part, 0] for part in segments], reader.interval),
    )


def _with_coil(
    state: LearningState, explained: ExplainedEvent, explanation: Explanation, reader: EventReader
) -> tuple[LearningState, bool, bool]:
    """Whether energizing the coil shows in an event that had all of it, and whether it is taken out from now on.

    Then what was learned so far was of other line pressures than those that come.
    """
    reading, white_sigma = explanation.reading, explanation.reading.white_sigma
    unaware = replace(reading.cost, offset=None)
    energizing, is_disturbed = state.energizing.after(
        explained.window._replace(output=explained.recorded.output),
        explanation.run,
        reading.cost.sigma * math.sqrt(reading.cost.temper),
        lambda window: replace(unaware, window=window, levels=explained.state.jitter.levels(window, white_sigma)),
        reader.wide,
        reader.interval,
        learned_of(explanation.theta, reading.cost.setting.coefficients).coefficients.line.control_flow > 0.0,
    )
    begins_anew = energizing.is_known and not state.energizing.is_known
    state = replace(state, energizing=energizing)
    if begins_anew:
        believed = explained.account.learned
        believed = replace(
            believed,
            belief=believed.belief.widened(reader.wide),
            statistics=no_statistics(),
            colour=None,
            at_rest=RestingNoise(),
        )
        state = replace(state, account=Account(believed))
    return state, is_disturbed, begins_anew


def _objections(
    state: LearningState, window: Window, learned: LearnedInjector, is_disturbed: bool, reader: EventReader
) -> tuple[adequacy.Objection, ...]:
    """Objections to an event, after which `learned` is believed; what names a cause first.

    Innovations that recent events leave alike, a little too loud or coloured, speak against the model together: in
    each by itself that is no more likely than noise, for an event at fault pays for its loudness anew.
    """
    theta = learned.theta
    reasons = [Reason.COIL_CURRENT] if is_disturbed else []
    offset = float(theta[Parameter.LINE_PRESSURE_OFFSET]) * reader.pressure_scale
    gain, untold = (float(theta[Parameter.LINE_PRESSURE_GAIN]), learned.belief.sigma[Parameter.LINE_PRESSURE_GAIN])
    pressure = float(window.inputs[:, 0].mean()) * reader.pressure_scale
    if abs(gain) > Z_95 * reader.calibration.gain > 0.0:
        offset = math.inf
    reasons += adequacy.sensor_objections(offset, sensor_lag(theta), untold * pressure)
    delay = float(theta[Parameter.LIFT_DELAY]) * LAG_UNIT
    if not EARLIEST_LIFT <= delay <= LATEST_LIFT:
        reasons.append(Reason.LIFT_SENSOR_LAG if delay > 0.0 else Reason.TIME_BASE)
    nozzle, stiffness = _open_nozzle_change(theta, window), float(theta[Parameter.BULK_MODULUS])
    if adequacy.looks_like_inertance(nozzle, stiffness, reader.calibration.line):
        reasons.append(Reason.AMBIGUOUS_SCALE)
    objections = tuple(adequacy.Objection(reason) for reason in reasons)
    phase = adequacy.inadequate_phase(learned.statistics)
    # of a needle that answers commands a lag is one with its delays
    if phase is None and window.needle is None and adequacy.is_no_law(theta, reader.wide):
        phase = Phase.OPENING
    if phase is not None or not reader.healthy.adequate:
        return (*objections, adequacy.Objection(Reason.MODEL_INADEQUATE, phase))
    return objections


def _open_nozzle_change(theta: Theta, window: Window) -> float:
    """N_H with the needle as open as it was in an event, at the steady sac pressure of the rail pressure."""
    widest = int(np.argmax(window.inputs[:, 1]))
    u = window.inputs[widest]
    return float(nozzle_change(theta, np.array([u[0], 0.0, 0.9 * u[0]]), u)[0])
