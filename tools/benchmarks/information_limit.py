"""The information limit (Cramer-Rao) of the mass: what no estimator with this prior and drift can beat.

The nominal structure with the named parameters of `joint_fit`, linearised at the true ones. Rail noise drives the
line, so the innovations of the Kalman predictor are what is white; the information of all earlier events counts, as
does the drift between them. The event's own innovations do not: its estimate is given while it happens.
"""

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.joint_fit import (
    DIFFERENCE,
    DRIFT_SIGMA,
    PRIOR_SIGMA,
    open_loop_rate,
    segments_of,
    sensitivities,
    steady_gain,
)
from tools.benchmarks.peer_equations import LAG, PARAMETERS
from tools.benchmarks.peer_inputs import PRESSURE_SCALE, PeerInputs
from tools.benchmarks.plant_parameters import Faults
from tools.benchmarks.windows import Windows


def true_parameters(faults: Faults) -> NDArray[np.float64]:
    """The parameters of `joint_fit` (PARAMETERS,) that are faults of the plant; other faults have none."""
    offset = faults.line_pressure_sensor_offset - faults.rail_pressure_sensor_offset
    return np.array(
        [
            faults.orifice_area,
            faults.seat_area,
            faults.line_friction,
            faults.guide_leakage,
            offset / PRESSURE_SCALE,
            faults.line_pressure_sensor_lag,
            faults.bulk_modulus,
        ]
    )


def mass_limits_mg(
    inputs: PeerInputs, windows: Windows, faults: tuple[Faults, ...], density: float
) -> tuple[float, ...]:
    """Smallest standard deviation of each event's mass [mg], given the events before it; `faults`: at every event."""
    covariance = np.diag(PRIOR_SIGMA**2)
    limits = []
    for number, segment in enumerate(segments_of(inputs)):
        theta = true_parameters(faults[number])
        gain, sigma = steady_gain(inputs, theta[LAG])

        def mass(theta: NDArray[np.float64]) -> float:
            rate = np.zeros(inputs.stream.output.size)
            rate[segment.first : segment.closed] = open_loop_rate(inputs, segment, theta, gain)  # noqa: B023
            return windows.event_masses_mg(rate, density)[number]  # noqa: B023

        base = mass(theta)
        steps = DIFFERENCE * PRIOR_SIGMA
        slope = np.array(
            [mass(theta + step * unit) - base for step, unit in zip(steps, np.eye(PARAMETERS), strict=True)]
        )
        slope /= steps
        limits.append(float(np.sqrt(slope @ covariance @ slope)))
        _, slopes = sensitivities(inputs, segment, theta, gain)
        information = np.linalg.inv(covariance) + slopes.T @ slopes / sigma**2
        covariance = np.linalg.inv(information) + np.diag(DRIFT_SIGMA**2)
    return tuple(limits)
