"""How far the needle opens: the lift at which long openings stay, for the scale of the sensor."""

from observer_rt.foundation.compiled import inner
from observer_rt.observer.stream.state import RING, Observer

NEAR = 0.1  # share by which a lift may differ from the highest so far and be that of the same stop
REMEMBERED = 20  # openings
_MASK = RING - 1


@inner
def follow_opening(observer: Observer, position: int) -> None:
    """At a sample with the needle open: note where it stays, the highest such lift of the opening."""
    memory = observer.memory[0]
    lift = observer.ring[position & _MASK].lift
    if not abs(lift - memory.level) <= memory.lift_on:
        memory.level, memory.level_count = lift, 1
        return
    memory.level_count += 1
    memory.level += (lift - memory.level) / memory.level_count
    if memory.level_count >= observer.constants.timing.bounce:
        memory.highest = max(memory.highest, memory.level)


@inner
def take_opening(observer: Observer) -> None:
    """The needle is shut: the highest lift at which it stayed is that of the stop, if it is not far below others."""
    memory = observer.memory[0]
    highest = memory.highest
    memory.highest, memory.level_count = 0.0, 0
    if highest > (1.0 + NEAR) * memory.stop:
        memory.stop, memory.stop_openings = highest, 1
    elif highest > (1.0 - NEAR) * memory.stop:
        memory.stop_openings += 1
        memory.stop += (highest - memory.stop) / min(memory.stop_openings, REMEMBERED)
