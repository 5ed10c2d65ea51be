"""From signals and their noise to the samples a bus carries. Imports nothing of `observer_rt`."""

import numpy as np

from tools.benchmarks.arrays import Array

HIGHEST_CODE = 0xFFFD  # of the 16-bit codes on the bus


def means(values: Array, noise: Array, every: int) -> Array:
    """Means over the `every` intervals that end at every `every`-th value: straight lines join the values."""
    between = np.append(values[:1], 0.5 * (values[1:] + values[:-1]))
    return _block_means(between, every) + _block_means(noise, every)


def coded(values: Array, step: float, floor: float) -> Array:
    """What 16 bits make of values: rounded to steps above the floor, clipped at both ends."""
    return np.clip(np.rint((values - floor) / step), 0, HIGHEST_CODE) * step + floor


def _block_means(values: Array, every: int) -> Array:
    """Mean over the block that ends at every `every`-th value, the first block made up of the first value."""
    whole = values[: (values.size - 1) // every * every + 1]
    blocks = np.concatenate((np.full(every - 1, values[0]), whole)).reshape(-1, every)
    return np.asarray(blocks.mean(axis=1), np.float64)
