"""Mistakes of a bench file: `check` names each with key and remedy, and `run` starts with none of them."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command

BENCH = """[link]
interface = "virtual"
channel = "mistakes"
fd = true
bit_rate = 500e3
data_bit_rate = 5e6
[[dbc]]
file = "observer_fd.dbc"
[signals.rail_pressure]
message = "SampleBlock"
pattern = "RailPressure_{:02d}"
time_base = "device"
[signals.needle_lift]
message = "SampleBlock"
pattern = "NeedleLift_{:02d}"
[signals.line_pressure]
message = "SampleBlock"
pattern = "LinePressure_{:02d}"
[sampling]
rate_hz = 50e3
meaning = "instant"
bridge_ms = 0.5
[noise]
line_pressure_MPa = 0.15
[outputs]
injection_rate = "InjectionRate"
injector_id = 1
status_period_ms = 100
[learning]
enabled = true
event_gap_ms = 10
"""
RAIL = 'pattern = "RailPressure_{:02d}"'
LIFT = 'pattern = "NeedleLift_{:02d}"'
LINE = 'pattern = "LinePressure_{:02d}"'
END = ""
"""Where what is added has no place of its own."""
FUEL = '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = '
RECORDING = '[recording]\nrail_pressure = { column = "p" }\nneedle_lift = { column = "x" }\nline_pressure = '

MISTAKES = {  # what stands there, what stands there instead, and words that are said of it
    "a bracket is missing": ("[sampling]", "[sampling", "line 19", "is not valid TOML"),
    "key twice": ("rate_hz = 50e3", "rate_hz = 50e3\nrate_hz = 50e3", "line 21", "TOML"),
    "nothing in it": (BENCH, "", "dbc", "--print-example-bench"),
    "unknown key": ("rate_hz =", "rate_hzz =", "sampling.rate_hzz", "did you mean 'rate_hz'?"),
    "unknown key of an optional role": (END, f'{FUEL}"X"\nunits = "K"', "fuel_temperature.units", "'unit'"),
    "signal of a role that is none": ("[signals.needle_lift]", "[signals.lift]", "signals.lift", "needle_lift"),
    "no database": ('[[dbc]]\nfile = "observer_fd.dbc"', "", "dbc", "is missing", "--print-example-bench"),
    "text for a section": ("[sampling]", 'model = "injector.toml"\n[sampling]', "line_pressure.model"),
    "text for a list": (RAIL, 'signals = "RailPressure_00"', "rail_pressure.signals", "a list in brackets"),
    "text for a switch": ("enabled = true", 'enabled = "yes"', "learning.enabled", "true or false"),
    "switch for a number": ("bridge_ms = 0.5", "bridge_ms = true", "sampling.bridge_ms", "a valid number"),
    "number for a name": ('"mistakes"', "0", "link.channel", "a text in quotes"),
    "text for a number": ("injector_id = 1", 'injector_id = "one"', "outputs.injector_id", "a valid integer"),
    "half a number": ("injector_id = 1", "injector_id = 1.5", "outputs.injector_id", "a valid integer"),
    "unknown interface": ('"virtual"', '"sockecan"', "link.interface", "'sockecan'", "'socketcan'?"),
    "no channel": ('"mistakes"', '""', "link.channel"),
    "bit rate in kbit/s": ("\nbit_rate = 500e3", "\nbit_rate = 500", "link.bit_rate", "equal to 5000"),
    "CAN FD on a classic bus": ("fd = true", "fd = false", "link.fd", "is a CAN FD message", "set link.fd = true"),
    "more than the bus carries": ("rate_hz = 50e3", "rate_hz = 500e3", "link.data_bit_rate", "of 6 ms: 130%"),
    "no such database": ("observer_fd.dbc", "nowhere.dbc", "dbc.0.file", "nowhere.dbc does not exist"),
    "a database that is none": ("observer_fd.dbc", "bench.toml", "bench.toml", "canconvert"),
    "unknown message": ("SampleBlock", "SampleBlok", "signals.rail_pressure.message", "SampleBlock"),
    "unknown signal": (LIFT, 'signal = "NeedleLift"', "signals.needle_lift", "NeedleLift_00"),
    "pattern without braces": (LIFT, 'pattern = "NeedleLift_"', "signals.needle_lift", "NeedleLift_00"),
    "two ways to name samples": (LIFT, f'{LIFT}\nsignal = "X"', "signals.needle_lift", "exactly one"),
    "no way to name samples": (f"{LIFT}\n", "", "signals.needle_lift", "exactly one"),
    "fewer samples of one input": (LIFT, 'signal = "NeedleLift_00"', "signals.needle_lift", "as many samples"),
    "unit that is none": (LINE, f'{LINE}\nunit = "barg"', "signals.line_pressure.unit", "'barg'", "bar"),
    "unit of another quantity": (LIFT, f'{LIFT}\nunit = "MPa"', "signals.needle_lift.unit", "'MPa'", "um"),
    "counter beside an index": (LIFT, f'{LIFT}\nindex = "SampleIndex"\ncounter = "Counter"',
        "signals.needle_lift.counter", "index"),
    "time base of one input of a message": (LIFT, f'{LIFT}\ntime_base = "other"',
        "signals.needle_lift.time_base", "SampleBlock", "same for all signals"),
    "lag too long": (LIFT, f"{LIFT}\nlag_us = 1500", "signals.needle_lift.lag_us", "less than or equal to 150"),
    "lag of the rail pressure": (RAIL, f"{RAIL}\nlag_us = 5", "rail_pressure", "'lag_us'", "'filter_delay_us'"),
    "delay of a filter too long": (LINE, f"{LINE}\nfilter_delay_us = 900", "filter_delay_us", "equal to 500"),
    "a slower needle lift": (LIFT, f"{LIFT}\nrate_hz = 10e3", "signals.needle_lift.rate_hz", "lift"),
    "hold of a signal that is not slower": (RAIL, f"{RAIL}\nmax_hold_ms = 5",
        "signals.rail_pressure.max_hold_ms", "slower", "leave it out"),
    "optional input from nowhere": (END, f'{FUEL}"Fuel"', "signals.fuel_temperature", "FuelTemperature"),
    "optional input of another quantity": (END, f'{FUEL}"FuelTemperature"\nunit = "bar"',
        "signals.fuel_temperature.unit", "'bar'", "degC"),
    "no time for an optional input": (END, f'{FUEL}"FuelTemperature"\ntimeout_ms = 0',
        "signals.fuel_temperature.timeout_ms", "greater than 0"),
    "rate in kHz": ("rate_hz = 50e3", "rate_hz = 50", "sampling.rate_hz", "greater than or equal to 1000"),
    "rate too low for the model": ("50e3", "1e3", "sampling.rate_hz", "integration steps a sample"),
    "no noise": ("MPa = 0.15", "MPa = 0", "noise.line_pressure_MPa", "greater than 0"),
    "a choice that is none": ('"instant"', '"average"', "sampling.meaning", "'instant' or 'mean'"),
    "unknown summary": ("injector_id = 1", 'injection_summary = "X"', "outputs.injection_summary", "message X"),
    "message of an input for results": ('"InjectionRate"', '"SampleBlock"',
        "outputs.injection_rate", "message SampleBlock has no signal"),
    "identifier of an input": ("injector_id = 1", "injection_rate_id = 0x100",
        "outputs.injection_rate_id", "SampleBlock and InjectionRate share 0x100"),
    "identifier beyond CAN": ("injector_id = 1", "status_id = 0x20000000", "outputs.status_id", "536870911"),
    "one message for two results": ("injector_id = 1", 'status = "InjectionSummary"',
        "outputs", "2 results share the message InjectionSummary", "give each its own"),
    "input for a result": ("injector_id = 1", 'status = "SampleBlock"', "status_id", "share 0x100"),
    "no such injector file": (END, '[model]\nfile = "x.toml"\n', "model.file", "x.toml does not exist"),
    "a folder for the injector file": (END, '[model]\nfile = "."\n', "bench.toml: model.file", "folder"),
    "a bench file for the injector file": (END, '[model]\nfile = "bench.toml"\n',
        "bench.toml: link: unknown key", "fluid"),
    "journal in no folder": (END, '[state]\njournal = "no/all.sqlite"\n', "state.journal", "no such folder"),
    "state and journal in one": (END, '[state]\nfile = "x"\njournal = "x"\n', "state.journal", "another"),
    "state in the bench file": (END, '[state]\nfile = "bench.toml"\n', "bench.toml: state.file"),
    "saved at no time": (END, "[state]\nsave_within_s = 0\n", "state.save_within_s", "greater than or equal to 0.1"),
    "column without a name": (END, f"{RECORDING}{{}}\n", "line_pressure.column"),
    "unit of a column": (END, f'{RECORDING}{{ column = "q", unit = "furlong" }}\n',
        "recording.line_pressure", "'furlong'", "MPa"),
    "two separators": (END, f'{RECORDING}{{ column = "q" }}\nseparator = ";;"\n',
        "recording.separator", "at most 1 character"),
    "separator and decimal alike": (END, f'{RECORDING}{{ column = "q" }}\nseparator = ","\ndecimal = ","\n',
        "recording", "decimal"),
    "factor of nothing": (END, f'{RECORDING}{{ column = "q", factor = 0 }}\n', "recording.line_pressure", "factor"),
}  # fmt: skip


def said_of(command: Command, path: Path) -> str:
    checked = command("check", "--bench", path)
    assert checked.code in (1, 2)
    return checked.err if checked.code == 2 else " ".join(checked.out.split())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_named(command: Command, tmp_path: Path, mistake: str) -> None:
    old, new, *words = MISTAKES[mistake]
    assert old in BENCH
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace(old, new, 1) if old else BENCH + new, encoding="utf-8")
    said = said_of(command, path)
    assert str(tmp_path) in said
    assert all(word in said for word in words), said


@pytest.mark.parametrize("mistake", ["unknown key", "more than the bus carries"])
def test_run_does_not_start_with_what_check_finds(command: Command, tmp_path: Path, mistake: str) -> None:
    """Whether it is found while the file is read, or by a rule of `check`."""
    old, new, *words = MISTAKES[mistake]
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace(old, new, 1), encoding="utf-8")
    said = command.refused("run", "--bench", path)
    assert "remedy: " in said
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("encoding", "before"), [("latin-1", "# Prüfstand\n"), ("cp1252", "\n# 5 µm\n"), ("utf-16", "")]
)
def test_file_that_is_not_utf_8(command: Command, tmp_path: Path, encoding: str, before: str) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(before + BENCH, encoding=encoding)
    said = command.refused("check", "--bench", path)
    assert f"{path}" in said
    assert "save it as UTF-8" in said


def test_mark_of_utf_8_is_passed_over(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH, encoding="utf-8-sig")
    command.done("check", "--bench", path)
