"""Stepper of the pair x~ and x^ from sample to sample: the only part of the stream that knows line and phi."""

from typing import Any

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
