"""TDMS of LabVIEW: channels with their units, and their own time where they have waveform properties."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from nptdms import TdmsFile

from observer_rt.files.signals.column import Column

_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit")  # properties


def columns(path: Path) -> Iterator[Column]:
    """Channels of numbers and moments; of several groups by `group/channel`."""
    with TdmsFile.open(path) as file:
        groups = file.groups()
        for number, group in enumerate(groups):
            for channel in group.channels():
                values = np.asarray(channel[:])
                if values.ndim != 1 or values.dtype.kind not in "iufM":
                    continue
                name = f"{group.name}/{channel.name}" if len(groups) > 1 else channel.name
                properties = channel.properties
                unit = next((str(properties[each]) for each in _UNITS if properties.get(each)), "")
                has_time = float(properties.get("wf_increment", 0.0)) > 0.0
                yield Column(name, values, unit, channel.time_track() if has_time else None, number)
