"""Many frames in one call: as far as Python need not be asked. Compiled."""

from observer_rt.bus.frame_block import FrameBlock
from observer_rt.foundation.compiled import inner_separate
from observer_rt.service.compiled.pipeline import Pipeline, handle
from observer_rt.service.compiled.publisher import FRAMES

FULL = FRAMES // 4  # rate frames ready, beyond which there is room for those of one input frame only


@inner_separate
def take_many(pipeline: Pipeline, block: FrameBlock, first: int) -> tuple[int, bool]:
    """Take frames of a block from `first` on: number of the next one, and whether Python must do something first.

    Stops where taking them one by one would have Python do something: also when an event has closed or an input is to
    be read, when so many rates are ready that they must be collected, and after every frame where that is asked for.
    """
    memory = pipeline.heard.memory[0]
    closed = pipeline.observer.memory[0].events_closed
    for number in range(first, block.keys.size):
        payload = block.data[block.starts[number] : block.starts[number + 1]]
        if handle(pipeline, block.keys[number], payload, block.stamps[number]):
            return number + 1, True
        if (
            pipeline.observer.memory[0].events_closed != closed
            or pipeline.publisher.memory[0].frames >= FULL
            or memory.looks_at_each
            or memory.came != memory.read
        ):
            return number + 1, False
    return block.keys.size, False
