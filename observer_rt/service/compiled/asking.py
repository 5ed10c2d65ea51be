"""When compiled code that takes frames must stop for Python, whoever gives it the frames."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.foundation.compiled import inner
from observer_rt.observer.stream.state import RING, Observer


class Need(IntEnum):
    """Why it stopped; it goes on when it is called again."""

    NOTHING = 0  # it was told to, or all is done
    VERDICT = 1  # the stream waits for one
    INPUT = 2  # before the next frame is taken Python must look at the optional inputs


ASKING = np.dtype(
    [
        ("taken", np.int64),  # frames
        # Python looks at the optional inputs at frames that carry one, and
        ("answered", np.int64),  # number of the frame for which it did last, from 1
        ("answered_at", np.int64),  # index of the newest sample then: again if the index begins anew,
        ("ask_at", np.int64),  # .. from this index on,
        ("ask_at_rest", np.bool_),  # .. and outside every event
        ("looks_at_each", np.bool_),  # Python wants to see what became of every frame
    ],
    align=True,
)


class Asking(NamedTuple):
    """What compiled code and Python tell each other of optional inputs."""

    memory: NDArray[np.void]  # (1,) ASKING
    keys: NDArray[np.int64]  # of frames that bring one


def make_asking(messages: Sequence[MessageLayout]) -> Asking:
    """Nothing taken, nothing answered; messages: those with optional inputs."""
    keys = [frame_key(each.frame_id, each.is_extended, each.bus) for each in messages]
    return Asking(np.zeros(1, ASKING), np.array(keys, np.int64))


@inner
def is_asked_for(asking: Asking, observer: Observer, key: int) -> bool:
    """Whether Python must look at the optional inputs before the next frame is taken, and has not yet."""
    memory = asking.memory[0]
    if asking.keys.size == 0 or memory.answered == memory.taken + 1:
        return False
    for number in range(asking.keys.size):
        if asking.keys[number] == key:
            return True
    stream = observer.memory[0]
    if memory.ask_at_rest and not stream.in_event:
        return True
    if stream.received == 0:
        return bool(memory.answered == 0)
    newest = observer.ring[(stream.received - 1) & (RING - 1)].index
    return bool(newest < memory.answered_at or newest >= memory.ask_at)
