"""Watches the running mean of normalised innovations squared (NIS) against a limit, at every sample."""

from observer_rt.foundation.compiled import compiled, inlined
from observer_rt.foundation.continuity import Doubt
from observer_rt.observer.stream.state import Observer

MEMORY = 16.0  # samples the running mean square remembers; its own standard deviation for white noise is .25
LARGEST = 20.0  # variances a single square counts for: three spikes are no contradiction
LIMIT = 5.0  # of the mean square; no injector of `tools/bench accuracy` that is valid shows more than 3
CALM = 2.5  # of the mean square: noise, four standard deviations at most
_NO_DOUBT = int(Doubt.NONE)


@inlined
def watch(observer: Observer, innovation: float, doubt: int) -> None:
    """Take in an innovation of x~ [p_0]; what contradicts the model stays so until an event after it has passed.

    doubt: `Doubt` of its sample; one that is not to be trusted contradicts nothing. Squares, for the line swings:
    innovations of both signs would make up for each other.
    """
    memory = observer.memory[0]
    if doubt != _NO_DOUBT or memory.doubted != _NO_DOUBT:
        memory.surprise = 0.0
        return
    square = min(innovation * innovation * memory.innovation_weight, LARGEST)
    memory.surprise += (square - memory.surprise) / MEMORY
    if memory.surprise > LIMIT and memory.synchronised and not memory.contradicted:
        memory.contradicted = True
        memory.contradicted_in = memory.event_number if memory.in_event else memory.event_number + 1


@compiled
def end_contradiction(observer: Observer, is_resting: bool, is_new: bool) -> None:
    """A contradiction that came with the needle long shut is a channel's, and over when that is well again.

    is_new: it came with this sample. One that lasts until an opening lasts until an event has passed.
    """
    memory = observer.memory[0]
    if is_new:
        memory.contradicted_at_rest = is_resting
        memory.calm = 0
    memory.contradicted_at_rest = memory.contradicted_at_rest and is_resting
    memory.calm = memory.calm + 1 if memory.surprise < CALM else 0
    if memory.contradicted_at_rest and memory.calm >= observer.constants.timing.good:
        memory.contradicted = False
