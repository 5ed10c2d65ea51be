"""Follows samples with the model as given, open loop, block by block."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import Terms
from observer_rt.engine.estimation.predictor import NO_COMMANDS, NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.engine.stream.state import Constants
from observer_rt.model.forcing import NO_CLOCK, Clock


class Follower:
    """x^ without correction, from a state on; the measured line pressure does not matter."""

    def __init__(self, constants: Constants) -> None:
        self.constants = constants
        """Constants in force from the next block on."""
        self.begin(np.full(constants.coefficients.states, np.nan))

    def begin(self, x: NDArray[np.float64], clock: Clock = NO_CLOCK) -> None:
        """Be in a state x (states,) at a sample, at which the clock of the terms shows this."""
        self._x, self._terms = x, Terms(self.constants.program, *clock)

    def along(
        self, rows: NDArray[np.void], commands: NDArray[np.float64] = NO_COMMANDS
    ) -> NDArray[np.float64]:
        """Injection rate (n,) [m3/s] at samples (n,); the state belongs to the first, where the rate is 0.

        rows: dtype `SAMPLE` or `sample_dtype`; commands (k, 2): as of `Window`.
        """
        constants, c = self.constants, self.constants.coefficients
        errors, rate = np.empty((2, len(rows)))
        setting = Setting(
            constants.interval, constants.substeps, c, np.zeros(c.states), program=constants.program
        )
        window = Window(
            inputs=np.column_stack([rows["rail_pressure"], rows["seat_area"]]),
            output=np.zeros(len(rows)),
            resting=rows["resting"].copy(),
            start=np.append(self._x, self._x[0]),
            opening=0,
            knots=np.column_stack([rows["lift_after"], rows["lift_area"]]),
            commands=commands,
        )
        self._x = follow(window, setting, nothing_learned(c), 0, errors, rate, None, NO_SLOPES, self._terms)
        return rate
