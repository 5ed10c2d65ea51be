"""One stroke of a needle as samples of an injector that learning is given."""

import numpy as np

from observer_rt.core.model.model import advance_state
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import Network, constant_network
from tests.engine.sample_stream import NOISE, NOMINAL
from tests.intervals import Interval

CONSTANTS = constants_for(NOMINAL, 100e3, Durations(), events_required=2)
SCALE = CONSTANTS.coefficients.pressure_scale


def stroke_of(
    c: Coefficients = CONSTANTS.coefficients,
    network: Network = constant_network(),  # noqa: B008
    samples: int = 700,
    seed: int | None = None,
) -> Window:
    """A window at 100 kHz, of a lump line worn as the network says; seed: of its noise, None: without."""
    time = np.arange(samples) / 100e3
    area = np.interp(time, [1.0e-3, 1.3e-3, 2.1e-3, 2.4e-3], [0.0, 0.9, 0.9, 0.0])
    x = np.array([0.95, 0.0, 0.0])
    line = [x[0]]
    for k in range(samples - 1):
        u_start, u_end = (0.95, float(area[k])), (0.95, float(area[k + 1]))
        advance_state(x, Interval(u_start, u_end, 1e-5, CONSTANTS.substeps), c, network, None)
        line.append(x[0])
    output = np.array(line)
    if seed is not None:
        output += np.random.default_rng(seed).normal(0.0, NOISE.line_pressure / SCALE, samples)
    inputs = np.column_stack([np.full(samples, 0.95), area])
    return Window(inputs, output, time < 1.0e-3, np.array([0.95, 0.0, 0.0, 0.95]), opening=100)
