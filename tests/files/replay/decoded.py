"""What frames of recordings say, by plain cantools."""

from collections.abc import Sequence

import cantools.database
import numpy as np

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.files.replay.framing import TimedFrame

DATABASE = cantools.database.load_file(EXAMPLE_BENCH.with_name("observer_fd.dbc"))
SIGNALS = ("RailPressure", "NeedleLift", "LinePressure")
TO_SI = np.array([1e6, 1e-6, 1e6])


def decoded(frames: Sequence[TimedFrame]) -> dict[int, dict[int, float]]:
    """By column (rail, lift, line) and sample index: the values [SI] in the frames, nan where not available."""
    result: dict[int, dict[int, float]] = {0: {}, 1: {}, 2: {}}
    for frame in frames:
        message = DATABASE.get_message_by_frame_id(frame.frame_id)
        raw = message.decode(frame.payload, scaling=False, decode_choices=False)
        values = message.decode(frame.payload, decode_choices=False)
        for name, value in values.items():
            kind, _, number = name.partition("_")
            if kind in SIGNALS:
                column, index = SIGNALS.index(kind), int(values["SampleIndex"]) + int(number)
                assert index not in result[column]
                result[column][index] = np.nan if raw[name] == 0xFFFF else float(value) * TO_SI[column]
    return result
