"""MDF4 recordings: exact round trip, units read from the channels, errors that name the channel."""

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal
from numpy.typing import NDArray

from observer_rt.files.formats import open_recording, read_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError

TIME = np.arange(10) / 1e5
VALUES = np.linspace(1.0, 2.0, 10)
UNITS = {"rail_pressure": "MPa", "needle_lift": "mm", "line_pressure": "bar"}
TWO_LIFTS = {"rail_pressure": "MPa", "NeedleLift": "mm", "needle_lft": "mm", "line_pressure": "MPa"}


def channels(units: dict[str, str]) -> list[Signal]:
    return [Signal(VALUES, TIME, name=name, unit=unit) for name, unit in units.items()]


def write(path: Path, *groups: list[Signal]) -> Path:
    with MDF() as file:
        for group in groups:
            file.append(group)
        file.save(path, overwrite=True)
    return path


def message(path: Path) -> str:
    with pytest.raises(UserError) as raised:
        read_recording(path)
    return str(raised.value)


def test_the_same_recording_gives_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = Recording(TIME, VALUES, VALUES, VALUES)
    write_recording(tmp_path / "first.mf4", recording)
    monkeypatch.setattr("time.time", lambda: 2e9)  # another day
    write_recording(tmp_path / "second.mf4", recording)
    assert (tmp_path / "first.mf4").read_bytes() == (tmp_path / "second.mf4").read_bytes()


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("line_pressure", "MPa", 1e6),
        ("line_pressure", "bar", 1e5),
        ("needle_lift", "µm", 1e-6),
        ("injection_rate", "mm3/s", 1e-9),
    ],
)
def test_units(tmp_path: Path, name: str, unit: str, factor: float) -> None:
    recording = read_recording(write(tmp_path / "x.mf4", channels({**UNITS, name: unit})))
    np.testing.assert_allclose(recording.signals[name], VALUES * factor, rtol=1e-15)


@pytest.mark.parametrize("shift", [0.0, 4e-6])
def test_channels_in_separate_groups_are_put_on_one_grid(tmp_path: Path, shift: float) -> None:
    groups = [[channel] for channel in channels({**UNITS, "speed": "1/min"})]
    groups[2] = [Signal(VALUES, TIME + shift, name="line_pressure", unit="bar")]
    recording = read_recording(write(tmp_path / "x.mf4", *groups))
    assert recording.samples == 10
    np.testing.assert_allclose(recording.rail_pressure, VALUES * 1e6)
    assert np.nanmax(np.abs(recording.line_pressure - np.interp(TIME, TIME + shift, VALUES) * 1e5)) < 1e5


def test_samples_marked_invalid_are_not_available(tmp_path: Path) -> None:
    invalid = np.zeros(10, dtype=bool)
    invalid[4] = True
    signals = channels(UNITS)
    signals[2] = Signal(VALUES, TIME, name="line_pressure", unit="MPa", invalidation_bits=invalid)
    recording = read_recording(write(tmp_path / "x.mf4", signals))
    assert np.flatnonzero(np.isnan(recording.line_pressure)).tolist() == [4]


def lift(values: NDArray[np.float64]) -> list[Signal]:
    rail, _, line = channels(UNITS)
    return [rail, Signal(values, TIME, name="needle_lift", unit="mm"), line]


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        ([channels({**UNITS, "line_pressure": "torr"})], "channel line_pressure: unit 'torr' is not known"),
        ([channels({**UNITS, "needle_lift": ""})], "channel needle_lift: has no unit"),
        ([channels(TWO_LIFTS)], "needle_lift: could be 'NeedleLift' or 'needle_lft'"),
        ([channels(UNITS), channels({"needle_lift": "mm"})], "channel needle_lift: appears 2 times"),
        (
            [[Signal(VALUES, TIME + (TIME > 5.5e-5), name=name, unit=unit) for name, unit in UNITS.items()]],
            "sample 6: gap in time",
        ),
        *(
            ([lift(np.where(np.arange(10) == 7, value, VALUES))], f"channel needle_lift: sample 7 is {value:g} mm")
            for value in (np.inf, -np.inf, 1e306)  # which no measurement has
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, groups: list[list[Signal]], said: str) -> None:
    assert said in message(write(tmp_path / "x.mf4", *groups))


def test_a_channel_named_with_its_device_is_one(tmp_path: Path) -> None:
    """INCA and CANape name it so; asammdf finds it by both names, and either will do in a bench file."""
    names = dict(zip((r"p_Rail\ETKC:1", r"NeedleLift\AD:1", r"p_Line\AD:1"), UNITS.values(), strict=True))
    stream = open_recording(write(tmp_path / "x.mf4", channels(names)))
    assert stream.names == {"rail_pressure": "p_Rail", "needle_lift": "NeedleLift", "line_pressure": "p_Line"}
    again = write(tmp_path / "y.mf4", channels(names), channels({r"p_Rail\XCP:1": "MPa"}))
    assert r"could be 'p_Rail\ETKC:1' or 'p_Rail\XCP:1'" in message(again)


@pytest.mark.parametrize("content", [b"", b"not a measurement " * 100])
def test_other_files(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mf4"
    path.write_bytes(content)
    assert "not an MDF file" in message(path)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.99])
def test_truncated_file(tmp_path: Path, share: float) -> None:
    path = tmp_path / "x.mf4"
    write_recording(path, Recording(TIME, VALUES, VALUES, VALUES))
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    assert str(path) in message(path)
