"""Observer over its stream of samples: the operations at every sample, in their order."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

CHANGE_MEMORY: float
CLOSE: float
CONFIRM: int
DIFFERENCE_GAIN: float
ENOUGH_SAMPLES: int
FEWEST_OPENING: int
FEWEST_REPEATS: int
FOOT: float
FURTHEST_OFFSET: float
FURTHEST_ZERO: float
INJECTIONS: int
LIFT_MEMORY: int
LONG_PAST: int
LOOK_BACK: int
LOWEST: float
MAX_EVENT: int
MOST_COEFFICIENTS: int
MOST_CROSSTALK: float
OFFSET_FOLLOWS: float
PENDING_EVENTS: int
REACH: int
RECORDED_RING: int
RECORDS: Mapping[str, tuple[memoryview, Mapping[str, Any]]]
RESTLESS: float
RING: int
SHORT: int
SLOTS: int
SLOWEST_OPENING: float
SLOW_PEAK: float
STEP: float

def dead_band(lift_noise: float) -> tuple[float, float]: ...
def reason_and_state(facts: Any) -> tuple[int, int]: ...

class PairStepper: ...

class Stream:
    def __init__(
        self,
        memory: Any,
        recorded: Any,
        ring: Any,
        x_tilde: Any,
        x_hat: Any,
        gains: Any,
        events: Any,
        injections: Any,
        channels: Any,
        theta: Any,
        verdicts: Any,
        verdict_gains: Any,
        verdict_theta: Any,
    ) -> None: ...
    def put_constants(self, constants: Any) -> None: ...
    def bind(self, stepper: PairStepper) -> None: ...
    def take(self, end: int, doubt: int) -> None: ...
    def advance(self) -> bool: ...
    def judged(self) -> bool: ...
    def carry_on(self, slot: int) -> None: ...
    def expect(self, at_rest: float) -> None: ...
    def step_pairs(self, first: int, end: int) -> None: ...
    def watch(self, innovation: float, doubt: int) -> None: ...
    def end_contradiction(self, is_resting: bool, is_new: bool) -> None: ...

def copy_window(
    ring: NDArray[np.void],
    start: int,
    late: int,
    inputs: NDArray[np.float64],
    output: NDArray[np.float64],
    resting: NDArray[np.bool_],
    knots: NDArray[np.float64],
    masked: NDArray[np.bool_],
) -> None: ...
