"""Frames of the example databases, encoded by cantools as the devices of such benches send them."""

from collections.abc import Iterator
from pathlib import Path

import cantools.database
from cantools.database.can import Database

from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.device import encoded

DATABASES = Path(__file__).parents[1] / "bus" / "databases"
INJECTIONS = 3


def database(name: str) -> Database:
    return cantools.database.load_file(DATABASES / f"{name}.dbc")


def classic_frames(data: Recording) -> Iterator[TimedFrame]:
    """One sample a frame, Motorola, the three channels one after the other."""
    messages = [
        database("testbed_classic").get_message_by_name(f"DAQ_{n}") for n in ("RailPress", "NeedleLift", "LinePress")
    ]
    for n in range(data.samples):
        for message, prefix, name, value in zip(
            messages,
            ("RP", "NL", "LP"),
            ("RailPressure", "Lift", "LinePressure"),
            (data.rail_pressure[n] / 1e5, data.needle_lift[n] / 1e-6, data.line_pressure[n] / 1e5),
            strict=True,
        ):
            values = {f"{prefix}_MsgCnt": n, f"{prefix}_{name}": float(value), f"{prefix}_SensorState": 1}
            yield encoded(message, values)


def fd_frames(data: Recording) -> Iterator[TimedFrame]:
    """Blocks of twelve: pressures in one message, the lift as floats in another."""
    pressures = database("fast_daq_fd").get_message_by_name("FD_Pressures")
    needle = database("fast_daq_fd").get_message_by_name("FD_Needle")
    for first in range(0, data.samples - 11, 12):
        values = {"SampleNo": float(first), "Status": 0.0}
        lifts = dict(values)
        for k in range(12):
            values[f"pRail_{k + 1}"] = data.rail_pressure[first + k] / 1e3
            values[f"pLine_{k + 1}"] = data.line_pressure[first + k] / 1e3
            lifts[f"xNeedle_{k + 1}"] = data.needle_lift[first + k] / 1e-3
        yield encoded(pressures, values)
        yield encoded(needle, lifts)


CHANNELS = {"Rail": ("rail_pressure", 1e6), "Lift": ("needle_lift", 1e-3), "Line": ("line_pressure", 1e6)}


def multiplexed_frames(data: Recording) -> Iterator[TimedFrame]:
    """Six samples in two halves of each of three channels; slow channels in between."""
    message = database("adc_multiplexed").get_message_by_name("ADC_Data")
    for first in range(0, data.samples - 5, 6):
        for half in range(2):
            for n, (name, (role, unit)) in enumerate(CHANNELS.items()):
                values = {"ADC_Channel": 3.0 * half + n, "ADC_Overrange": 0.0, "ADC_Time": float(first)}
                for k in range(3 * half, 3 * half + 3):
                    values[f"ADC_{name}_{k}"] = float(getattr(data, role)[first + k]) / unit
                yield encoded(message, values)
        if first % 60 == 0:
            slow = {"ADC_Channel": 15, "ADC_Overrange": 0, "ADC_Time": first, "ADC_Page": 0, "ADC_Temperature": 42.0}
            yield encoded(message, slow)
