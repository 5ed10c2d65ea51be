"""Follows samples with a model open loop, block by block; the model as given is the nominal one."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import Terms
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window
from observer_rt.engine.estimation.scalars import nothing_learned
from observer_rt.engine.stream.state import Constants
from observer_rt.model.forcing import NO_CLOCK, Clock
from observer_rt.model.network import Network, constant_network

_NO_KNOTS = np.empty((0, 2))


class Follower:
    """x^ without correction, from a state on; the measured line pressure does not matter."""

    def __init__(self, constants: Constants, network: Network | None = None) -> None:
        """network: that of phi; None: nothing is learned."""
        self.constants = constants
        """Constants in force from the next block on."""
        self._network = network or constant_network()
        self.begin(np.full(constants.coefficients.states, np.nan))

    def begin(self, x: NDArray[np.float64], clock: Clock = NO_CLOCK) -> None:
        """Be in a state x (states,) at a sample, at which the clock of the terms shows this."""
        self._x, self._terms = x, Terms(self.constants.program, *clock)

    def along(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """`run` along an observer's samples (n,), dtype `SAMPLE` or `sample_dtype`."""
        inputs = np.column_stack([rows["rail_pressure"], rows["seat_area"]])
        knots = np.column_stack([rows["lift_after"], rows["lift_area"]])
        return self.run(inputs, rows["resting"].copy(), knots)

    def run(
        self,
        inputs: NDArray[np.float64],
        resting: NDArray[np.bool_],
        knots: NDArray[np.float64] = _NO_KNOTS,
        phi: NDArray[np.float64] | None = None,
        line_pressure: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Injection rate (n,) [m3/s] at samples; the state belongs to the first, where the rate is 0.

        inputs (n, 2), resting (n,), knots (n, 2): as in `Window`; phi (3, n) [1/s], line_pressure (n,),
        normalised: filled, if given.
        """
        constants, c = self.constants, self.constants.coefficients
        errors, rate = np.empty((2, len(inputs)))
        setting = Setting(
            constants.interval, constants.substeps, c, np.zeros(c.states), program=constants.program
        )
        window = Window(inputs, np.zeros(len(inputs)), resting, np.append(self._x, self._x[0]), 0, knots)
        learned = nothing_learned(c)._replace(network=self._network)
        before = float(self._x[0])
        self._x = follow(window, setting, learned, 0, errors, rate, None, NO_SLOPES, self._terms, phi)
        if line_pressure is not None:
            np.negative(errors, out=line_pressure)  # of an output that is 0
            line_pressure[:1] = before
        return rate
