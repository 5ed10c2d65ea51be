"""Options that several commands at a desk share."""

from pathlib import Path
from typing import Annotated

from observer_rt.files.canlog.can_log import LogFormat
from observer_rt.files.formats import BUILT_IN, formats, suffixes_of
from observer_rt.files.signals.signal_format import SignalFormat
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import Argument, Option

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
BenchFile = Annotated[Path, Option("Bench file (default: the example bench of the package).")]
Decoder = Annotated[
    Path | None, Option("Bench file that says how to read CAN logs and files of your own layout.")
]
Model = Annotated[Path | None, Option("Injector file, instead of the bench file's.")]
State = Annotated[Path | None, Option("Learned state to start from.")]
FuelTemperature = Annotated[
    float | None, Option("Fuel temperature [degC] (default: reference_temperature of the injector file).")
]
SampleRate = Annotated[float, Option("Samples a second [Hz].", minimum=1.0)]
FromChannel = Annotated[
    tuple[str, ...],
    Option(
        "Channel with the inputs, where a CAN log has several; LINK=CHANNEL for one bus of [links].",
        "[LINK=]CHANNEL",
    ),
]
Force = Annotated[bool, Option("Replace existing files.")]
Json = Annotated[bool, Option("Results as JSON on stdout.")]
