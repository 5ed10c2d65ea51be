"""Words of the service: states, reasons, counters and log lines, and the remedy for each.

The one table of them, but for counters. Log, view and value tables use `Words.what`; docs/operating.md has all.
"""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from observer_rt.bus.mapping.output_signals import StatusValues, rows_of
from observer_rt.engine.stream.state import Reason, State


@dataclass(frozen=True)
class Words:
    """Meaning of something, in a few words, and what to do about it."""

    what: str
    remedy: str = "nothing"


class Topic(StrEnum):
    """Subject of a log line."""

    START = "start"
    STOP = "stop"
    STATE = "state"
    INJECTION = "injection"
    MEASURED = "measured"
    ENERGIZING = "energizing"
    INPUT = "input"
    VALUE = "value"
    SENDER = "sender"
    LINK = "link"
    KEPT = "kept"
    STREAM = "stream"
    LEARNING = "learning"


STATES: Mapping[State, Words] = {
    State.STARTING: Words("no sample was observed yet", "wait a second; else the log says which input is missing"),
    State.WAITING_FOR_DATA: Words("no input comes in", "see the reason"),
    State.RUNNING_NOMINAL: Words("observing with the model as given, nothing was learned yet"),
    State.ADAPTED: Words("observing with what was learned"),
    State.DEGRADED: Words("observing, but nothing is valid", "see the reason"),
}

REASONS: Mapping[Reason, Words] = {
    Reason.NONE: Words("nothing is the matter"),
    Reason.STARTING: Words("the observer has just begun", "wait for 3 ms of closed needle"),
    Reason.JUMPED: Words("the source paused, the observer settles again", "nothing, if it sends windows"),
    Reason.SAMPLES_LOST: Words(
        "input samples are missing",
        "see DroppedFrames (slow computer), CrcErrors (disturbed bus), else the log (sensor)",
    ),
    Reason.DEVICE_RESTARTED: Words("a measuring device was restarted", "nothing, if meant; else its power supply"),
    Reason.NUMERICAL: Words(
        "the model ran out of bounds and began anew", "check units and injector file; report it with a log"
    ),
    Reason.NEEDLE_STUCK: Words(
        "the needle was open longer than any injection", "check sensor, unit, offset and sign"
    ),
    Reason.TOO_FEW_EVENTS: Words("too few injections were judged yet", "take the mass, or wait for two injections"),
    Reason.INPUT_TIMEOUT: Words("no frame of any input comes", "switch the devices on; check cable and bit rate"),
    Reason.MODEL_INADEQUATE: Words(
        "the injector does not behave as its model",
        "check injector file and units; `observer-rt fit` calibrates it, `observer-rt discover` finds what it lacks",
    ),
    Reason.PRESSURE_OFFSET: Words(
        "line and rail pressure differ at standstill", "calibrate both sensors; check their units"
    ),
    Reason.SENSOR_LAG: Words(
        "the line-pressure sensor is implausibly slow",
        "check its filter, amplifier and mounting; state a lag that is meant: lag_us",
    ),
    Reason.NOT_LEARNED: Words(
        "the event could not be learned from", "nothing, if seldom; else samples are lost, or events too long"
    ),
    Reason.SUDDEN_CHANGE: Words("the event contradicts what was learned before it", "wait: what stays is learned"),
    Reason.AMBIGUOUS_SCALE: Words(
        "a changed line and a changed nozzle look alike here", "vary the rail pressure; measure the fuel temperature"
    ),
    Reason.UNTESTED: Words("the training in use has no test of its result", "update the observer that sends it"),
    Reason.TIME_BASE: Words(
        "when samples were taken is in doubt", "use one time base or an index; is a channel late? docs/time.md"
    ),
    Reason.REVISED: Words("learning from it changed its mass by too much", "update the observer that sends it"),
    Reason.INPUT_STALE: Words("one of the inputs stays away", "the log names its message: sensor, device, cable"),
    Reason.NOT_JUDGED: Words(
        "the event could not be tested, so nothing is known of it", "look for lost frames or a needle that stays open"
    ),
    Reason.CONTRADICTED: Words(
        "the line pressure has left what the model can do",
        "check sensors, units and cables; after a sudden change of the injector it passes",
    ),
    Reason.SECOND_SENDER: Words(
        "another node sends what only this observer should", "stop it, or change its [outputs]"
    ),
    Reason.NO_STANDSTILL: Words(
        "the needle is not shut long enough between injections", "leave 3 ms of shut needle, at least now and then"
    ),
    Reason.LIFT_ZERO: Words(
        "the lift of the shut needle is more than 40 um from zero",
        "calibrate its sensor; check mounting and temperature",
    ),
    Reason.INPUT_FROZEN: Words(
        "an input kept its value for longer than can be bridged", "check sensor, amplifier and device"
    ),
    Reason.INPUT_CLIPPED: Words("an input stays at the end of its range", "check the range of sensor and amplifier"),
    Reason.LIFT_SENSOR_LAG: Words(
        "the needle lift seems to be recorded late, which masses allow for",
        "run `observer-rt discover`: a changed nozzle looks alike; if it names needle_lift_sensor_lag, state lag_us "
        "(docs/time.md)",
    ),
    Reason.INPUT_PROTECTION: Words(
        "the end-to-end protection of an input is INVALID, it is not taken",
        "the log names the message: a second sender, a disturbed bus, or a wrong E2EProfile or E2EDataId",
    ),
    Reason.OUTSIDE_LEARNED_RANGE: Words(
        "what was learned does not reach such an injection",
        "wait: the next one like it is mostly valid; the log says what is known, and which recording would help",
    ),
    Reason.PRELIMINARY: Words(
        "without a needle lift the rate is known once the needle is shut", "take the corrected rate and the mass"
    ),
    Reason.LIFT_DEAD: Words(
        "the line pressure shows injections, the needle lift none",
        "check the sensor, its amplifier and cable; is it of this injector?",
    ),
    Reason.LEARNING_LATE: Words(
        "learning is late, and the event is unlike what was learned before",
        "a faster computer, fewer injections a second, or a longer learning_delay_ms",
    ),
    Reason.COIL_CURRENT: Words(
        "the coil's current shows in the line pressure", "shield the cables, or wait: once known it is subtracted"
    ),
    Reason.NO_COMMAND: Words(
        "the line pressure shows an injection that no command explains",
        "look for the lost command; its mass is by the line pressure alone, where that tells it",
    ),
}

COUNTERS: Mapping[str, Words] = {
    name: Words(row.counts, row.remedy) for name, row in rows_of(StatusValues).items() if row.counts
}


@dataclass(frozen=True)
class TopicWords(Words):
    """Words of log lines, which have a level of `logging`."""

    level: int = logging.INFO


TOPICS: Mapping[Topic, TopicWords] = {
    Topic.START: TopicWords("what is observed, the learned state, stamps; `ready` at last"),
    Topic.STOP: TopicWords("what was counted, when it ends"),
    Topic.STATE: TopicWords("state and reason have changed", "see states and reasons", logging.WARNING),
    Topic.INJECTION: TopicWords("one injection, valid or why not", "see the reasons"),
    Topic.MEASURED: TopicWords("a measured mass beside the estimate"),
    Topic.ENERGIZING: TopicWords(
        "an injection that is missing after its command", "injector, driver stage", logging.WARNING
    ),
    Topic.INPUT: TopicWords(
        "a message stays away, comes but cannot be used, or is back",
        "the device that sends it, its cable, bit rate and database",
        logging.WARNING,
    ),
    Topic.VALUE: TopicWords(
        "a signal says `not available`, is at the range's end, frozen or off",
        "sensor, cable, amplifier; unit and range in the database",
        logging.WARNING,
    ),
    Topic.SENDER: TopicWords("another node sends our identifiers", "as SECOND_SENDER", logging.WARNING),
    Topic.LINK: TopicWords(
        "an interface awaited, in trouble or back; frames lost, results unsent", "as the line says", logging.WARNING
    ),
    Topic.KEPT: TopicWords("what is kept on disk: restored, set aside, saved, or not", "room and rights"),
    Topic.LEARNING: TopicWords("an event that was only examined", "as the line says", logging.WARNING),
    Topic.STREAM: TopicWords(
        "nobody reads the JSON lines or the log, or too slowly", "start the reader again", logging.WARNING
    ),
}


def named(value: State | Reason) -> str:
    """Name and meaning, as the databases' value tables have it."""
    words = STATES[value] if isinstance(value, State) else REASONS[value]
    return f"{value.name}: {words.what}"


def is_good(state: State) -> bool:
    """Whether results can be valid in this state."""
    return state in (State.RUNNING_NOMINAL, State.ADAPTED)
