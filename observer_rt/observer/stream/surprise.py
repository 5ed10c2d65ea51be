"""Whether the innovations have left what noise can do: at every sample, between the judgements of events."""

import math

from numba import njit

from observer_rt.foundation.continuity import Doubt
from observer_rt.observer.stream.state import Observer

MEMORY = 16.0  # samples the running mean remembers
LARGEST = 8.0  # standard deviations a single innovation counts for: a spike is no contradiction
LIMIT = 4.0  # of the mean, whose own standard deviation is .18: eleven samples in a row at the largest
_NO_DOUBT = int(Doubt.NONE)


@njit(cache=True, nogil=True, inline="always")
def watch(observer: Observer, innovation: float, doubt: int) -> None:
    """Take in an innovation of x~ [p_0]; what contradicts the model stays so until an event after it has passed.

    doubt: `Doubt` of its sample; one that is not to be trusted contradicts nothing.
    """
    memory = observer.memory[0]
    if doubt != _NO_DOUBT or memory.doubted != _NO_DOUBT:
        memory.surprise = 0.0
        return
    score = min(max(innovation / memory.innovation_sigma, -LARGEST), LARGEST)
    memory.surprise += (score - memory.surprise) / MEMORY
    if math.fabs(memory.surprise) > LIMIT and memory.synchronised and not memory.contradicted:
        memory.contradicted = True
        memory.contradicted_in = memory.event_number if memory.in_event else memory.event_number + 1
