"""Optional inputs while frames are taken: values that count until they are too old, readings that wait for Python."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.codec import decode
from observer_rt.bus.database.e2e import E2EStatus
from observer_rt.bus.database.multiplexing import is_selected
from observer_rt.bus.mapping.input_tables import OPTIONAL_ROLES, Inputs
from observer_rt.config.signals import OptionalRole
from observer_rt.foundation.compiled import inner, inner_separate
from observer_rt.foundation.referenced import referenced
from observer_rt.model.parameters import HIGHEST_TEMPERATURE, LOWEST_TEMPERATURE
from observer_rt.observer.stream.state import INJECTIONS, RING, Observer, Reason

READINGS = 4096  # that wait: 0.8 s of blocks of 20 levels at 100 kHz
GRACE = 1.0  # s a value still counts after its sender said that it has none
STEP = 0.1  # K, below which the model stays: .04 % of the bulk modulus, less than injections differ by
PERIOD = 0.1  # s between two changes of the model

_LEARNING_ENABLE = OPTIONAL_ROLES.index(OptionalRole.LEARNING_ENABLE)
_FUEL_TEMPERATURE = OPTIONAL_ROLES.index(OptionalRole.FUEL_TEMPERATURE)
_TRUSTED, _STALE = int(Reason.NONE), int(Reason.INPUT_STALE)

_VALUE = np.dtype(
    [
        ("value", np.float64),  # SI, the newest, nan: none
        ("left", np.float64),  # samples for which it counts
        ("follows", np.bool_),  # by the protection of its message no frame was lost since
    ],
    align=True,
)
_READING = np.dtype(
    [
        ("row", np.int64),  # of `Inputs.optional`
        ("stamp", np.int64),  # ns
        ("follows", np.bool_),
        # when it came
        ("processed", np.int64),  # samples
        ("closed", np.int64),  # injections
    ],
    align=True,
)
_MEMORY = np.dtype(
    [
        ("newest", np.int64),  # index of the newest sample when a frame came last, -1: there was none
        ("may_learn", np.bool_),  # by the bench
        ("learning", np.bool_),  # .. and by its learning enable
        ("measured", np.float64),  # temperature of the fuel [K] that counts, nan: none
        ("fuel_temperature", np.float64),  # of the model in force [K], nan: it waits for one
        ("is_assumed", np.bool_),  # for none was measured yet
        ("since_change", np.float64),  # samples since the model changed
        ("is_due", np.bool_),  # Python must change the model before samples are observed
        # of `readings` and `values`
        ("came", np.int64),
        ("read", np.int64),  # by Python, which
        ("looks_at_each", np.bool_),  # .. wants to see what became of every frame
    ],
    align=True,
)


@referenced()
class InputMemory(NamedTuple):
    """What came of the optional inputs; those whose order counts wait in a ring for Python."""

    memory: NDArray[np.void]  # (1,)
    newest: NDArray[np.void]  # (optional inputs,)
    readings: NDArray[np.void]  # (READINGS,)
    values: NDArray[np.float64]  # (READINGS, most signals of an input) SI


def make_input_memory(inputs: Inputs, may_learn: bool, fuel_temperature: float | None) -> InputMemory:
    """Nothing came yet; fuel_temperature [K]: until it is measured, None: nothing is valid."""
    memory, newest = np.zeros(1, _MEMORY), np.zeros(len(inputs.optional), _VALUE)
    memory["newest"] = -1
    memory["may_learn"] = memory["learning"] = may_learn
    memory["measured"] = math.nan
    memory["fuel_temperature"] = math.nan if fuel_temperature is None else fuel_temperature
    memory["is_assumed"] = fuel_temperature is not None
    memory["since_change"] = math.inf
    newest["follows"] = True
    return InputMemory(
        memory,
        newest,
        np.zeros(READINGS, _READING),
        np.zeros((READINGS, int(inputs.optional["signal_count"].max(initial=0)))),
    )


@inner_separate
def take_inputs(
    heard: InputMemory,
    inputs: Inputs,
    observer: Observer,
    number: int,
    payload: NDArray[np.uint8],
    status: E2EStatus,
    stamp: int,
) -> None:
    """Take what a good frame of a message says, before its samples; what stays away grows older with them.

    status: by its protection, OK without. A frame with the counter of the one before brings nothing new.
    """
    _grow_older(heard, observer)
    message = inputs.messages[number]
    if status != E2EStatus.REPEATED:
        follows = status == E2EStatus.OK or status == E2EStatus.INITIAL
        for n in range(message.first_optional, message.first_optional + message.optional_count):
            row = inputs.optional[n]
            heard.newest[n].follows &= follows
            if is_selected(payload, inputs.selection, row.first_condition, row.condition_count):
                _read(heard, inputs, observer, n, payload, stamp)
    _take_effect(heard, inputs, observer)


@inner
def _grow_older(heard: InputMemory, observer: Observer) -> None:
    """Time is that of the samples, whose index may begin anew."""
    memory = heard.memory[0]
    received = observer.memory[0].received
    if received == 0:
        return
    index = observer.ring[(received - 1) & (RING - 1)].index
    if memory.newest >= 0:
        elapsed = max(index - memory.newest, 0)
        memory.since_change += elapsed
        for n in range(heard.newest.size):
            heard.newest[n].left -= elapsed
    memory.newest = index


@inner
def _read(heard: InputMemory, inputs: Inputs, observer: Observer, n: int, payload, stamp: int) -> None:  # type: ignore[no-untyped-def]
    """Decode the input `n`: keep its value, or have its reading wait for Python."""
    memory, stream = heard.memory[0], observer.memory[0]
    row, newest = inputs.optional[n], heard.newest[n]
    values = heard.values[memory.came % READINGS]
    decode(payload, inputs.signals[row.first_signal : row.first_signal + row.signal_count], values)
    if row.is_placed and math.isnan(values[0]):
        return
    for k in range(int(row.is_placed), row.signal_count):
        values[k] = values[k] * row.factor + row.origin
    samples = 1.0 / observer.constants.interval
    if row.role == _FUEL_TEMPERATURE and not LOWEST_TEMPERATURE <= values[0] <= HIGHEST_TEMPERATURE:
        newest.left = min(newest.left, GRACE * samples)
    elif row.role == _FUEL_TEMPERATURE or row.role == _LEARNING_ENABLE:
        newest.value = values[0]
        newest.left = row.timeout * samples
        memory.is_assumed &= row.role != _FUEL_TEMPERATURE
    else:
        begun = stream.injections_begun
        is_under_way = begun > 0 and stream.injections[(begun - 1) % INJECTIONS].end < 0
        reading = heard.readings[memory.came % READINGS]
        reading.row = n
        reading.stamp = stamp
        reading.follows = newest.follows
        reading.processed = stream.processed
        reading.closed = begun - int(is_under_way)
        newest.follows = True
        memory.came += 1  # last: from here on Python may read it


@inner
def _take_effect(heard: InputMemory, inputs: Inputs, observer: Observer) -> None:
    """What counts now, of what is known and of what was for too long: whether to learn, and the fuel wanted.

    The model changes outside events only; nothing is valid while the fuel is not known.
    """
    memory, stream = heard.memory[0], observer.memory[0]
    for n in range(heard.newest.size):
        value = heard.newest[n].value if heard.newest[n].left > 0.0 else math.nan
        if inputs.optional[n].role == _LEARNING_ENABLE:
            memory.learning = memory.may_learn and value != 0.0
        elif inputs.optional[n].role == _FUEL_TEMPERATURE:
            memory.measured = value
            is_known, is_in_force = not math.isnan(value), not math.isnan(memory.fuel_temperature)
            is_near = abs(value - memory.fuel_temperature) < STEP
            is_too_soon = memory.since_change * observer.constants.interval < PERIOD
            memory.is_due = is_known and not (is_near or is_too_soon or stream.in_event)
            stream.doubted = _TRUSTED if memory.is_assumed or (is_known and is_in_force) else _STALE
