"""Optional inputs while frames are taken: values that count until they are too old, readings that wait for Python."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import Inputs
from observer_rt.core.frames.frames import READINGS

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
