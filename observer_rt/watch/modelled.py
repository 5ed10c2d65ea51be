"""What the model says of an injection that was seen on the bus: as given, and with the wear that was published."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.estimation.learned import Learned
from observer_rt.estimation.predictor import Setting, Window, interval_before, knot_before
from observer_rt.foundation.compiled import compiled
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.model.borrowed import borrowed_network
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.integrator import advance_over
from observer_rt.model.line.interface import rest_line
from observer_rt.model.network import Network, constant_network
from observer_rt.model.right_hand_side import fault_and_rate
from observer_rt.model.sac import empty_sac
from observer_rt.model.seat import normalised_area
from observer_rt.observer.stream.front_end import dead_band
from observer_rt.service.compiled.constants import bench_constants, configured_noise


class Modelled(NamedTuple):
    """Of n samples: rate [mm3/ms] (n,) and phi [1/s] (3, n), 0 with the needle shut."""

    rate: NDArray[np.float64]
    phi: NDArray[np.float64]


class InjectionModel:
    """Runs the model of an injector open loop over the samples of an injection, from standstill."""

    def __init__(self, fitted: BenchInjector) -> None:
        constants = bench_constants(fitted)
        self.coefficients: Coefficients = constants.coefficients
        self._dead_band = dead_band(configured_noise(fitted).needle_lift)[0]
        self._setting = Setting(
            constants.interval,
            constants.substeps,
            constants.coefficients,
            np.zeros(constants.coefficients.states),
        )

    def __call__(
        self,
        rail_pressure: NDArray[np.float64],
        needle_lift: NDArray[np.float64],
        nozzle_wear: float = 0.0,
        seat_wear: float = 0.0,
    ) -> Modelled:
        """rail_pressure (n,), normalised by (24), of which the first is the line's at rest; needle_lift (n,) [m].

        nozzle_wear v_H, seat_wear v_S: relative changes of the flows, (27).
        """
        c, n = self.coefficients, needle_lift.size
        lift = np.where(needle_lift < self._dead_band, 0.0, needle_lift)
        area = np.array([normalised_area(each, c.seat) for each in lift.tolist()])
        state = np.zeros(c.states)
        rest_line(state, float(rail_pressure[0]), c.line)
        window = Window(
            inputs=np.column_stack([rail_pressure, area]),
            output=np.zeros(n),
            resting=np.cumsum(area) == 0.0,  # once it was open, the sac drains by itself
            start=state,
            opening=0,
        )
        learned = Learned(constant_network(nozzle_wear, seat_wear), c, 0.0, 0.0)
        result = Modelled(np.zeros(n), np.zeros((3, n)))
        _walk(window, self._setting, c, learned.network, state, result)
        return Modelled(result.rate / MM3_PER_MS, result.phi)


@compiled
def _walk(
    window: Window,
    setting: Setting,
    c: Coefficients,
    network: Network,
    x: NDArray[np.float64],
    result: Modelled,
) -> None:
    """Fill `result`, rates in m3/s; x: the state at the first sample, which goes along."""
    lent = borrowed_network(network)
    for k in range(1, window.inputs.shape[0]):
        interval = interval_before(window, setting, k)
        advance_over(x, interval, knot_before(window, k), c, lent, None)
        if window.resting[k]:
            empty_sac(x, None)
        phi, rate = fault_and_rate(x, interval.end, c, lent)
        result.rate[k] = rate
        for row in range(3):
            result.phi[row, k] = phi[row]
