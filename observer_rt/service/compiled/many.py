"""Many frames in one call: as far as Python need not be asked. Compiled."""

from observer_rt.bus.frame_block import FrameBlock
from observer_rt.foundation.compiled import inner_separate
from observer_rt.service.compiled.asking import Asking, Need, is_asked_for
from observer_rt.service.compiled.pipeline import Pipeline, handle
from observer_rt.service.compiled.publisher import FRAMES

FULL = FRAMES // 4  # rate frames ready, beyond which there is room for those of one input frame only

_NOTHING, _VERDICT, _INPUT = (int(each) for each in Need)


@inner_separate
def take_many(pipeline: Pipeline, asking: Asking, block: FrameBlock, first: int) -> tuple[int, int]:
    """Take frames of a block from `first` on: number of the next one, and `Need`.

    Stops where taking them one by one would have Python do something: besides what `Need` says when an event has
    closed, when so many rates are ready that they must be collected, and after every frame where that is asked for.
    """
    memory = asking.memory[0]
    closed = pipeline.observer.memory[0].events_closed
    for number in range(first, block.keys.size):
        if is_asked_for(asking, pipeline.observer, block.keys[number]):
            return number, _INPUT
        memory.taken += 1
        payload = block.data[block.starts[number] : block.starts[number + 1]]
        if handle(pipeline, block.keys[number], payload, block.stamps[number]):
            return number + 1, _VERDICT
        if (
            pipeline.observer.memory[0].events_closed != closed
            or pipeline.publisher.memory[0].frames >= FULL
            or memory.looks_at_each
        ):
            return number + 1, _NOTHING
    return block.keys.size, _NOTHING
