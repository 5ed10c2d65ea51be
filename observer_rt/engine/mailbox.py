"""Posts verdicts on closed events, and the knowledge at the start, into slots from which the stream takes them."""

from collections.abc import Sequence

import numpy as np

from observer_rt.core.stream.stream import PENDING_EVENTS, RING, SLOTS
from observer_rt.engine.estimation.parameters import Parameter, learned_of
from observer_rt.engine.estimation.predictor import GainSchedule
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.engine.learning.mass import EVERYWHERE, KnownFlow
from observer_rt.engine.stream.state import Observer, Reason

KNOWN_AFTER = 0.25e-3  # s, after which the flow of a pilot valve is known, beside its lead over the lift.
COMMAND_AFTER = 1e-3  # s, after which a command, which may come later than its samples, is known at the latest.


def begin_with(observer: Observer, knowledge: Knowledge, schedule: GainSchedule) -> None:
    """Let the stream carry the knowledge at the start, through slot 0."""
    _write(observer, 0, knowledge, schedule, EVERYWHERE)
    observer.stream.carry_on(0)
    observer.memory["innovation_noise"]["sigma"] = schedule.innovation_sigma
    observer.memory["operating_point"]["in_learned_range"] = True
    observer.stream.expect(0.0)


def has_room(observer: Observer, number: int) -> bool:
    """Whether a verdict may be posted on the `number`-th closed event (0, 1, ..): its slot is free."""
    return number < int(observer.memory[0]["judgement"]["events_taken"]) + SLOTS


def post_examined(
    observer: Observer,
    number: int,
    objections: Sequence[Objection],
    is_coloured: bool = False,
    earlier: Outcome | None = None,
) -> None:
    """Post objections to the `number`-th closed event; earlier: outcome of one before, to put into force with it."""
    if earlier is not None:
        _write_learned(observer, SLOTS + number % SLOTS, earlier)
        observer.verdicts[number % SLOTS]["earlier"] = number + 1
    _post(observer, number, "examined", objections, is_coloured)


def post_learned(observer: Observer, number: int, outcome: Outcome, is_coloured: bool = False) -> None:
    """Post what was learned from the `number`-th closed event; it goes before what was only examined."""
    _write_learned(observer, number % SLOTS, outcome)
    _post(observer, number, "learned", outcome.forward, is_coloured)


def _write_learned(observer: Observer, slot: int, outcome: Outcome) -> None:
    verdict = observer.verdicts[slot]
    _write(observer, slot, outcome.knowledge, outcome.schedule, outcome.known_flow)
    verdict["is_adopted"] = outcome.adoption is Adoption.ADOPTED
    verdict["innovation_sigma"] = outcome.schedule.innovation_sigma


def _post(observer: Observer, number: int, kind: str, objections: Sequence[Objection], is_coloured: bool) -> None:
    """Post the objections to the `number`-th closed event as a finding of a kind.

    With it goes the mean square at rest by which innovations are watched from then on, nan: as before.
    """
    finding = observer.verdicts[number % SLOTS][kind]
    finding["reason"] = objections[0].reason if objections else Reason.NONE
    finding["is_coloured"] = is_coloured
    finding["at_rest"] = _at_rest(observer, number) if is_coloured and not objections else np.nan
    finding["number"] = number + 1  # last: from here on the stream may take it


def _at_rest(observer: Observer, number: int) -> float:
    """Mean square of the innovations at rest, of half the remembered samples, before an event's end."""
    end = int(observer.events[number % PENDING_EVENTS]["end_position"]) + 1
    rows = observer.ring[np.arange(max(end - RING // 2, 0), end) % RING]
    at_rest = rows["innovation"][rows["resting"] & (rows["innovation"] != 0.0)]  # 0 where nothing was measured
    return float(np.mean(at_rest**2)) if at_rest.size else np.nan


def _write(
    observer: Observer, slot: int, knowledge: Knowledge, schedule: GainSchedule, known_flow: KnownFlow
) -> None:
    """Write into a slot the values that the stream is to carry, normalised as the stream counts."""
    constants = observer.constants
    learned = learned_of(knowledge.in_force, constants.coefficients)
    verdict = observer.verdicts[slot]
    observer.verdict_theta[slot] = knowledge.in_force
    carried = verdict["carried"]
    carried["curves"] = learned.network.curves.reshape(carried["curves"].shape)
    carried["bias"] = learned.network.bias
    carried["nozzle"] = learned.network.nozzle
    carried["rail_from"], carried["rail_to"], carried["known_from"], carried["known_until"] = known_flow
    carried["flow_spread"], colour = knowledge.state.elsewhere.spread, knowledge.state.learned.colour
    carried["coloured_noise"] = colour.loudest if colour else 0.0
    carried["learned_offset"] = constants.sensor.offset + learned.offset
    carried["sensor"] = learned.sensor
    carried["sensor"][0] += constants.sensor.lag
    carried["flow_factor"] = constants.calibration.level(knowledge.in_force[Parameter.LINE_PRESSURE_GAIN])
    line, valve = learned.coefficients.line, learned.coefficients.valve
    carried["line"][: len(line)] = line
    carried["valve"], carried["needle"] = valve, learned.needle
    later = COMMAND_AFTER if valve.commanded else KNOWN_AFTER + max(valve.start, valve.end)
    carried["watch_later"] = round(later / constants.interval) if line.control_flow > 0.0 else 0
    noise, scale = knowledge.state.noise, constants.coefficients.pressure_scale
    verdict["noise"] = noise.rail_pressure / scale, noise.needle_lift, noise.line_pressure / scale
    observer.verdict_gains[slot] = schedule.gains
