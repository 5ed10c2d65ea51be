"""Samples that lie between those of the grid, or further apart: brought onto it by straight lines.

Design 4.2 "Time", rules (2) and (4): a signal of another time base, or a slower one, has on the grid the value that
lies between its two neighbours. Neighbours too far apart are not joined: what lies between them is missing.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus.alignment import IMPOSSIBLE, store
from observer_rt.bus.alignment_memory import Alignment
from observer_rt.bus.inputs import MAX_INPUTS
from observer_rt.bus.timing import SLOTS

MISSED = 1.5  # spacings between two samples, from which on some are missing between them


@njit(cache=True, nogil=True)
def follow(alignment: Alignment, message: int, position: float, values: NDArray[np.float64]) -> None:
    """Take one sample of a follower: where it lies on the grid, and its values (MAX_INPUTS,) [SI].

    A sample without a value, or not after the last one, is left out.
    """
    memory = alignment.memory[0]
    follower = memory.followers[message]
    for role in range(MAX_INPUTS):
        if (follower.roles >> role) & 1 and not abs(values[role]) < IMPOSSIBLE[role]:
            return
    end = _end_of_grid(alignment)
    memory.newest = max(memory.newest, min(int(position), end + SLOTS // 2 + 1))
    distance = position - follower.position
    if follower.begun and distance <= 0.0:
        return
    if position >= end + SLOTS // 2:
        return  # it would take the place of samples that still wait
    if not follower.begun or distance > follower.reach:
        _begin(follower, position)
    else:
        last = math.floor(position)
        missed = distance > MISSED * follower.spacing
        for index in range(max(follower.next_index, memory.next_index, end - SLOTS + 1), last + 1):
            share = (index - follower.position) / distance
            for role in range(MAX_INPUTS):
                if (follower.roles >> role) & 1:
                    value = follower.values[role] + share * (values[role] - follower.values[role])
                    store(alignment, index, role, value, missed)
        follower.next_index = last + 1
    follower.stale = False
    follower.position = position
    follower.values[:] = values


@njit(cache=True, nogil=True)
def _end_of_grid(alignment: Alignment) -> int:
    """The index beyond all samples on the grid."""
    memory = alignment.memory[0]
    end = 0
    for m in range(memory.stream_count):
        if memory.streams[m].on_grid:
            end = max(end, memory.streams[m].next_index)
    return end


@njit(cache=True, nogil=True)
def _begin(follower, position: float) -> None:  # type: ignore[no-untyped-def]
    """Nothing is known before this sample."""
    if not follower.begun:
        follower.first_index = math.ceil(position)
    follower.begun = True
    follower.next_index = math.ceil(position)
