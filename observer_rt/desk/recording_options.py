"""Options that name recordings and CAN logs, with the formats there are."""

from pathlib import Path
from typing import Annotated

from observer_rt.files.formats import log_formats, signal_formats, suffixes_of
from observer_rt.foundation.options import Argument

_logs = log_formats()
SIGNALS = ", ".join(suffixes_of(signal_formats()))
LOGS = ", ".join(suffixes_of(_logs))
RECORDED = ", ".join(suffixes_of(each for each in _logs if each.recorder))
CLASSIC_ONLY = ", ".join(suffixes_of(each for each in _logs if not each.keeps_fd))

Recording = Annotated[Path, Argument(f"Recording ({SIGNALS}) or CAN log ({LOGS}).", "RECORDING")]
Recordings = Annotated[
    tuple[Path, ...], Argument(f"Recordings ({SIGNALS}) or CAN logs ({LOGS}).", "RECORDING")
]
