"""Optional inputs while frames are taken: values that count until they are too old, readings that wait for Python."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import Inputs
from observer_rt.core.frames.frames import READINGS, RECORDS
from observer_rt.foundation.records import dtype_of

_VALUE = dtype_of(RECORDS["OptionalValue"])
_READING = dtype_of(RECORDS["Reading"])
_MEMORY = dtype_of(RECORDS["OptionalMemory"])


class InputMemory(NamedTuple):
    """Optional inputs as received; those whose order counts wait in a ring for Python."""

    memory: NDArray[np.void]  # (1,)
    newest: NDArray[np.void]  # (optional inputs,)
    readings: NDArray[np.void]  # (READINGS,)
    values: NDArray[np.float64]  # (READINGS, most signals of an input) SI


def make_input_memory(inputs: Inputs, may_learn: bool, fuel_temperature: float | None) -> InputMemory:
    """Memory of no inputs yet; fuel_temperature [K]: until it is measured, None: nothing is valid."""
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
