"""Publisher of the observer's samples in injection-rate frames: every index once, in blocks that carry it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.codec import SIGNAL
from observer_rt.bus.mapping.output_messages import HEADER_SIGNALS, RateMessage
from observer_rt.core.frames.frames import FRAMES, RECORDS
from observer_rt.foundation.records import dtype_of

OUT_FRAME = dtype_of(RECORDS["OutFrame"])

PUBLISHER = dtype_of(RECORDS["PublisherMemory"])


class Publisher(NamedTuple):
    """Publisher as compiled functions see it; `out` holds `memory[0].frames` frames for the caller.

    values: the numbers to encode; the block's rates come last.
    """

    memory: NDArray[np.void]  # (1,) PUBLISHER
    table: NDArray[np.void]  # SIGNAL
    values: NDArray[np.float64]
    out: NDArray[np.void]  # (FRAMES,) OUT_FRAME


def make_publisher(message: RateMessage | None, learning: bool) -> Publisher:
    """Publisher of blocks of rates in `message`; None: of nothing."""
    if message is None:
        return Publisher(np.zeros(1, PUBLISHER), np.zeros(0, SIGNAL), np.zeros(0), np.zeros(0, OUT_FRAME))
    names = message.page.names
    publisher = Publisher(
        np.zeros(1, PUBLISHER), message.page.table, np.full(len(names), np.nan), np.zeros(FRAMES, OUT_FRAME)
    )
    memory = publisher.memory[0]
    memory["learning"] = learning
    memory["header"] = [names.index(name) if name in names else -1 for name in HEADER_SIGNALS]
    memory["samples"] = message.samples
    memory["length"] = message.layout.length
    memory["protection"] = message.layout.protection
    return publisher
