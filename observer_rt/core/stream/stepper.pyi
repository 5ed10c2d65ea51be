"""What steps the pair x~ and x^ from sample to sample: the only part of the stream that knows line and phi."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import PairStepper, Stream

class CarriedPhi: ...

class Stepper(PairStepper):
    def __init__(
        self,
        stream: Stream,
        coefficients: Any,
        sensor: Any,
        interval: float,
        substeps: int,
        program: Any,
        phi: CarriedPhi,
    ) -> None: ...
    def go_on_from(self, before: Stepper) -> None: ...
    def nominal_rates(
        self,
        observed: Stream,
        position: int,
        flows: bool,
        held: NDArray[np.float64],
        first: int,
        rates: NDArray[np.float64],
    ) -> tuple[int, bool]: ...
