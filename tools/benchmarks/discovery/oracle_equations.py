"""The plant on sampled inputs, following a measured line pressure. Imports nothing of `observer_rt`."""

from typing import NamedTuple

import numpy as np
from numba import njit

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant_equations import (
    STEPS_FLOWING,
    STEPS_SHUT,
    chamber_pressure,
    drift,
    kick,
    lagged,
    nozzle_factor,
    square_root,
)
from tools.benchmarks.plant_parameters import Faults, Injector


class Sampled(NamedTuple):
    """What the plant follows, at the samples (n,): rail pressure [Pa], lift [m], line pressure [Pa]."""

    rail: Array
    lift: Array
    line: Array


@njit(cache=True, nogil=True)
def follow(
    part: Injector, faults: Faults, sampled: Sampled, gain: Array, interval: float, errors: Array, rate: Array
) -> None:
    """Errors [Pa] and injection rate [m3/s] (n,) of a plant of one cell, its inputs linear between samples.

    gain (3,) on p_L, Q_L and the lagged p_L, after every sample; all 0 is open
    loop. Parts of a sample by which the line is recorded late are kept; whole samples are the caller's.
    """
    rail, lift, line = sampled
    q, p = np.zeros(1), np.full(1, rail[0])
    p_s, seen, recorded = part.chamber_pressure, rail[0], rail[0]
    late = interval - faults.channel_skew % interval
    errors[0], rate[0] = line[0] - recorded, 0.0
    for k in range(1, rail.shape[0]):
        shut = lift[k - 1] <= 0.0 and lift[k] <= 0.0 and p_s == part.chamber_pressure
        steps = STEPS_SHUT if shut else STEPS_FLOWING
        step = interval / steps
        lift1, rail1 = lift[k - 1], rail[k - 1]
        for j in range(steps):
            lift0, rail0, p_l0, seen0 = lift1, rail1, p[0], seen
            lift1 = lift[k - 1] + (lift[k] - lift[k - 1]) * (j + 1) / steps
            rail1 = rail[k - 1] + (rail[k] - rail[k - 1]) * (j + 1) / steps
            kick(q, p, rail0, 0.5 * step, part, faults)
            p_s = drift(q, p, p_s, lift0, lift1, step, part, faults)
            kick(q, p, rail1, 0.5 * step, part, faults)
            seen = lagged(seen0, p_l0, p[0], step, faults.line_pressure_sensor_lag)
            if j * step < late <= (j + 1) * step * (1.0 + 1e-12):
                recorded = seen0 + (seen - seen0) * (late / step - j)
        p_c = chamber_pressure(lift1, part, faults)
        rate[k] = nozzle_factor(p_s, p_c, lift1, part, faults) * square_root(p_s - p_c)
        errors[k] = line[k] - recorded
        p[0] += gain[0] * errors[k]
        q[0] += gain[1] * errors[k]
        seen += gain[2] * errors[k]
