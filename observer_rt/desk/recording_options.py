"""Options that name recordings and CAN logs, with the formats there are."""

from pathlib import Path
from typing import Annotated

from observer_rt.files.canlog.can_log import LogFormat
from observer_rt.files.formats import BUILT_IN, formats, suffixes_of
from observer_rt.files.signals.signal_format import SignalFormat
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import Argument

try:
    _formats = formats()
except UserError:  # of an installed format, which the commands that read files tell
    _formats = BUILT_IN
_logs = [each for each in _formats if isinstance(each, LogFormat)]
SIGNALS = ", ".join(suffixes_of(each for each in _formats if isinstance(each, SignalFormat)))
LOGS = ", ".join(suffixes_of(_logs))
RECORDED = ", ".join(suffixes_of(each for each in _logs if each.recorder))
CLASSIC_ONLY = ", ".join(suffixes_of(each for each in _logs if not each.keeps_fd))

Recording = Annotated[Path, Argument(f"Recording ({SIGNALS}) or CAN log ({LOGS}).", "RECORDING")]
Recordings = Annotated[
    tuple[Path, ...], Argument(f"Recordings ({SIGNALS}) or CAN logs ({LOGS}).", "RECORDING")
]
