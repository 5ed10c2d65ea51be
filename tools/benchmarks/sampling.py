"""From signals and their noise to the samples a bus carries. Imports nothing of `observer_rt`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tools.benchmarks.arrays import Array

PRESSURE_STEP, PRESSURE_FLOOR = 0.005e6, -10e6  # Pa, of the 16-bit code on the bus
LIFT_STEP, LIFT_FLOOR = 0.01e-6, -50e-6  # m
HIGHEST_CODE = 0xFFFD
RAIL_NOISE, LINE_NOISE, LIFT_NOISE = 0.1e6, 0.15e6, 0.4e-6  # Pa, Pa, m: white, per sample


@dataclass(frozen=True, eq=False)
class Measured:
    """Signals of the three sensors, at the end what the observer gets; SI, all (n,)."""

    time: Array
    rail_pressure: Array
    needle_lift: Array
    line_pressure: Array


Step = Callable[[Measured], Measured]
"""What becomes of the signals on their way to the bus."""


def sampled(
    seen: Measured, noise: Array, every: int, averaged: bool, after_noise: Sequence[Step] = ()
) -> Measured:
    """Every `every`-th sample, or means up to it, with white noise, as the bus has it.

    noise: (3, n) of rail pressure, lift and line pressure, in multiples of the usual; after_noise: what becomes of
    the samples then.
    """

    def slowed(values: Array, noise: Array) -> Array:
        return _means(values, noise, every) if averaged else (values + noise)[::every]

    measured = Measured(
        seen.time[::every],
        slowed(seen.rail_pressure, RAIL_NOISE * noise[0]),
        slowed(seen.needle_lift, LIFT_NOISE * noise[1]),
        slowed(seen.line_pressure, LINE_NOISE * noise[2]),
    )
    for step in after_noise:
        measured = step(measured)
    return Measured(
        measured.time,
        _coded(measured.rail_pressure, PRESSURE_STEP, PRESSURE_FLOOR),
        _coded(measured.needle_lift, LIFT_STEP, LIFT_FLOOR),
        _coded(measured.line_pressure, PRESSURE_STEP, PRESSURE_FLOOR),
    )


def _means(values: Array, noise: Array, every: int) -> Array:
    """Means over the `every` intervals that end at every `every`-th value: straight lines join the values."""
    between = np.append(values[:1], 0.5 * (values[1:] + values[:-1]))
    return _block_means(between, every) + _block_means(noise, every)


def _block_means(values: Array, every: int) -> Array:
    """Mean over the block that ends at every `every`-th value, the first block made up of the first value."""
    whole = values[: (values.size - 1) // every * every + 1]
    blocks = np.concatenate((np.full(every - 1, values[0]), whole)).reshape(-1, every)
    return np.asarray(blocks.mean(axis=1), np.float64)


def _coded(values: Array, step: float, floor: float) -> Array:
    return np.clip(np.rint((values - floor) / step), 0, HIGHEST_CODE) * step + floor
