"""The model as it is given, with nothing learned, beside the observer."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.evaluation.trace import Signal
from observer_rt.foundation.continuity import Break
from observer_rt.model.integrator import Interval, advance_over
from observer_rt.model.right_hand_side import injection_rate
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.observer import make_observer
from observer_rt.observer.stream.pair import coefficients_in_force, network_in_force
from observer_rt.observer.stream.state import RING, Observer
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.learners import make_learner

_MASK = RING - 1
_NONE = int(Break.NONE)
_STATE = np.dtype([("position", np.int64), ("flows", np.bool_)], align=True)


class NominalModel:
    """Follows an observer's samples: open loop from the state in which that found the line before an injection."""

    def __init__(self, fitted: BenchInjector) -> None:
        constants = bench_constants(fitted)
        start = no_knowledge(configured_noise(fitted), constants.coefficients.pressure_scale)
        self._nominal = make_observer(constants, start, make_learner(fitted, constants, start))
        self._state = np.zeros(1, _STATE)
        self._x = np.full(constants.coefficients.states, np.nan)

    def rates(self, observer: Observer, first: int, end: int) -> Signal:
        """Rates [m3/s] at positions [first, end), processed and remembered; nan where the observer has none.

        Call it without gaps.
        """
        rates = np.empty(end - first)
        nominal = self._nominal._replace(constants=observer.constants)  # of fuel as warm as it is
        _rates(observer.ring, nominal, self._state, self._x, first, rates)
        return rates


@njit(cache=True, nogil=True)
def _rates(
    ring: NDArray[np.void],
    nominal: Observer,
    state: NDArray[np.void],
    x: NDArray[np.float64],
    first: int,
    rates: NDArray[np.float64],
) -> None:
    """x: the model's state at state.position, up to which it was followed; it flows while its last rate is not 0.

    A needle that is shut with nothing flowing is passed over until it opens again or the line is at rest.
    """
    c, network, memory = coefficients_in_force(nominal), network_in_force(nominal), state[0]
    for place in range(rates.size):
        position = first + place
        row = ring[position & _MASK]
        rates[place] = 0.0
        if row.resting or row.broken != _NONE:
            x[:] = row.x_tilde
            memory.position = position
            memory.flows = False
        elif row.seat_area > 0.0 or memory.flows:
            if position - memory.position >= RING:
                x[:] = np.nan
                memory.position = position - 1
            for number in range(memory.position + 1, position + 1):
                before, after = ring[(number - 1) & _MASK], ring[number & _MASK]
                interval = Interval(
                    (before.rail_pressure, before.seat_area),
                    (after.rail_pressure, after.seat_area),
                    nominal.constants.interval,
                    nominal.constants.substeps,
                )
                advance_over(x, interval, (before.lift_after, before.lift_area), c, network, None)
            memory.position = position
            rates[place] = injection_rate(x, (row.rail_pressure, max(row.seat_area, 0.0)), c, network)
            memory.flows = rates[place] != 0.0
        if np.isnan(row.injection_rate):
            rates[place] = np.nan
