"""Mistakes of a bench file: `check` names each with key and remedy and fails, and `run` starts with none of them."""

from pathlib import Path

import pytest

from tests.cli.conftest import Command

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
DBC = '[[dbc]]\nfile = "observer_fd.dbc"'
RECORDING = '[recording]\nrail_pressure = { column = "p" }\nneedle_lift = { column = "x" }\n'
RECORDED_LINE = 'line_pressure = { column = "q" }\n'
TWO = "[injectors.left.outputs]\nstatus_period_ms = 100\n[injectors.right.outputs]\nstatus_period_ms = 100\n"

MISTAKES = {
    # the file as such
    "a bracket is missing": ("[sampling]", "[sampling", ("line 19", "TOML")),
    "decimal comma": ("rate_hz = 50e3", "rate_hz = 50000,0", ("line 20", "TOML")),
    "text without quotes": ('meaning = "instant"', "meaning = instant", ("line 21", "TOML")),
    "key twice": ("rate_hz = 50e3", "rate_hz = 50e3\nrate_hz = 50e3", ("line 21", "TOML")),
    "section twice": ("[noise]", "[link]\nfd = true\n[noise]", ("link", "TOML")),
    "nothing in it": (BENCH, "", ("dbc", "--print-example-bench")),
    "unknown section": ("[sampling]", "[sampels]", ("sampels", "did you mean 'sampling'?")),
    "unknown key": ("rate_hz =", "rate_hzz =", ("sampling.rate_hzz", "did you mean 'rate_hz'?")),
    "signal of a role that is none": (
        "[signals.needle_lift]",
        "[signals.lift]",
        ("signals.lift", "needle_lift"),
    ),
    "message of a role is missing": (
        f'message = "SampleBlock"\n{LIFT}',
        LIFT,
        ("signals.needle_lift.message",),
    ),
    "no database": (DBC, "", ("dbc", "[[dbc]]")),
    # types
    "one bracket for a list of sections": ("[[dbc]]", "[dbc]", ("dbc", "write [[dbc]], with two brackets")),
    "text for a section": ("[sampling]", 'model = "injector.toml"\n[sampling]', ("line_pressure.model",)),
    "text for a list": (
        RAIL,
        'signals = "RailPressure_00"',
        ("signals.rail_pressure.signals", 'signals = ["A", "B"]'),
    ),
    "numbers for a list of texts": (
        RAIL,
        "signals = [0, 1]",
        ("signals.rail_pressure.signals.0", "in quotes"),
    ),
    "number for a list of numbers": ("[noise]", "[realtime]\ncpus = 3\n[noise]", ("realtime.cpus", "[3]")),
    "text for a switch": ("enabled = true", 'enabled = "yes"', ("learning.enabled", "true or false")),
    "number for a switch": ("enabled = true", "enabled = 1", ("learning.enabled", "true or false")),
    "text for fd": ("fd = true", 'fd = "on"', ("link.fd", "true or false")),
    "number with its unit": (
        "rate_hz = 50e3",
        'rate_hz = "50 kHz"',
        ("sampling.rate_hz", "1000 to 1000000 Hz"),
    ),
    "number in quotes": ("rate_hz = 50e3", 'rate_hz = "50e3"', ("sampling.rate_hz", "1000 to 1000000 Hz")),
    "switch for a number": ("bridge_ms = 0.5", "bridge_ms = true", ("sampling.bridge_ms", "0 to 5 ms")),
    "number for a name": (
        'channel = "mistakes"',
        "channel = 0",
        ("link.channel", 'a text in quotes, such as channel = "..."'),
    ),
    "switch for a name": (
        'injection_rate = "InjectionRate"',
        "injection_rate = true",
        ("outputs.injection_rate", "in quotes", "false"),
    ),
    "text for a number": ("injector_id = 1", 'injector_id = "one"', ("outputs.injector_id", "0 to 255")),
    "half a number": ("injector_id = 1", "injector_id = 1.5", ("outputs.injector_id", "whole number")),
    "list for a number": ("rate_hz = 50e3", "rate_hz = [50e3]", ("sampling.rate_hz", "1000 to 1000000 Hz")),
    # buses
    "unknown interface": (
        '"virtual"',
        '"sockecan"',
        ("link.interface", "'sockecan'", "did you mean 'socketcan'?"),
    ),
    "no channel": ('"mistakes"', '""', ("link.channel",)),
    "bit rate in kbit/s": ("bit_rate = 500e3", "bit_rate = 500", ("link.bit_rate", "bit/s")),
    "bit rate beyond CAN": ("\nbit_rate = 500e3", "\nbit_rate = 500e6", ("link.bit_rate", "bit/s")),
    "data rate below the bit rate": (
        "data_bit_rate = 5e6",
        "data_bit_rate = 50e3",
        ("link.data_bit_rate", "bit/s"),
    ),
    "no bit rate": ("\nbit_rate = 500e3", "\nbit_rate = 0", ("link.bit_rate", "bit/s")),
    "CAN FD on a classic bus": ("fd = true", "fd = false", ("link.fd", "set link.fd = true")),
    "two links, one channel": (
        "[[dbc]]",
        '[links.lift]\nchannel = "mistakes"\n[[dbc]]',
        ("links.lift.channel", "another channel"),
    ),
    "link without a channel": ("[[dbc]]", "[links.lift]\n[[dbc]]", ("links.lift.channel", "missing")),
    "unknown link": (LIFT, f'{LIFT}\nlink = "lift"', ("signals.needle_lift.link", "add [links.lift]")),
    # databases
    "no such database": (
        '"observer_fd.dbc"',
        '"nowhere.dbc"',
        ("dbc.0.file", "nowhere.dbc does not exist", "observer_fd.dbc"),
    ),
    "a database that is none": ('"observer_fd.dbc"', '"bench.toml"', ("bench.toml", "bus database")),
    # signals
    "unknown message": (
        f'message = "SampleBlock"\n{LIFT}',
        f'message = "SampleBlok"\n{LIFT}',
        ("signals.needle_lift.message", "SampleBlock"),
    ),
    "unknown signal": (LIFT, 'signal = "NeedleLift"', ("signals.needle_lift", "NeedleLift_00")),
    "pattern of nothing": (LIFT, 'pattern = "Lift_{:02d}"', ("signals.needle_lift", "Lift_{:02d}")),
    "pattern without braces": (LIFT, 'pattern = "NeedleLift_"', ("signals.needle_lift", "NeedleLift_00")),
    "signal twice in a list": (
        LIFT,
        'signals = ["NeedleLift_00", "NeedleLift_00"]',
        ("signals.needle_lift", "listed twice"),
    ),
    "list of nothing": (LIFT, "signals = []", ("signals.needle_lift", "name")),
    "two ways to name samples": (
        LIFT,
        f'{LIFT}\nsignal = "NeedleLift_00"',
        ("signals.needle_lift", "exactly one"),
    ),
    "no way to name samples": (f"{LIFT}\n", "", ("signals.needle_lift", "exactly one")),
    "equal signals of two inputs": (
        LINE,
        RAIL,
        ("signals.line_pressure", "rail_pressure and line_pressure read the same signals"),
    ),
    "fewer samples of one input": (
        LIFT,
        'signal = "NeedleLift_00"',
        ("signals.needle_lift", "as many samples"),
    ),
    "unit that is none": (LINE, f'{LINE}\nunit = "barg"', ("signals.line_pressure.unit", "'barg'", "bar")),
    "unit of another quantity": (LIFT, f'{LIFT}\nunit = "MPa"', ("signals.needle_lift.unit", "'MPa'", "um")),
    "unknown index": (LIFT, f'{LIFT}\nindex = "Index"', ("signals.needle_lift.index", "Index")),
    "index that is none": (
        LIFT,
        f'{LIFT}\nindex = "Counter"',
        ("signals.needle_lift.index", "32 bits"),
    ),
    "counter beside an index": (
        LIFT,
        f'{LIFT}\nindex = "SampleIndex"\ncounter = "Counter"',
        ("signals.needle_lift.counter", "index"),
    ),
    "time base of one input of a message": (
        LIFT,
        f'{LIFT}\ntime_base = "other"',
        ("signals.needle_lift.time_base", "same for all signals"),
    ),
    "delay below 0": (LIFT, f"{LIFT}\ndelay_us = -5", ("signals.needle_lift.delay_us", "0 to 1000000 us")),
    "lag too long": (LIFT, f"{LIFT}\nlag_us = 1500", ("signals.needle_lift.lag_us", "0 to 150 us")),
    "lag of the rail pressure": (RAIL, f"{RAIL}\nlag_us = 5", ("signals.rail_pressure", "filter_delay_us")),
    "delay of a filter too long": (
        LINE,
        f"{LINE}\nfilter_delay_us = 900",
        ("signals.line_pressure.filter_delay_us", "0 to 500 us"),
    ),
    "a slower needle lift": (LIFT, f"{LIFT}\nrate_hz = 10e3", ("signals.needle_lift.rate_hz",)),
    "hold of a signal that is not slower": (
        RAIL,
        f"{RAIL}\nmax_hold_ms = 5",
        ("signals.rail_pressure.max_hold_ms", "leave it out"),
    ),
    "unknown optional signal": (
        "[sampling]",
        '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = "Fuel"\n[sampling]',
        ("signals.fuel_temperature", "FuelTemperature"),
    ),
    "optional input of another quantity": (
        "[sampling]",
        '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = "FuelTemperature"\nunit = "bar"\n[sampling]',
        ("signals.fuel_temperature.unit", "'bar'", "degC"),
    ),
    "no time for an optional input": (
        "[sampling]",
        '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = "FuelTemperature"\ntimeout_ms = 0\n[sampling]',
        ("signals.fuel_temperature.timeout_ms", "above 0 ms"),
    ),
    # numbers out of their range
    "rate in kHz": ("rate_hz = 50e3", "rate_hz = 50", ("sampling.rate_hz", "1000 to 1000000 Hz")),
    "rate that is no number": ("rate_hz = 50e3", "rate_hz = nan", ("sampling.rate_hz", "1000 to 1000000 Hz")),
    "bridge in us": ("bridge_ms = 0.5", "bridge_ms = 500", ("sampling.bridge_ms", "0 to 5 ms")),
    "no noise": ("MPa = 0.15", "MPa = 0", ("noise.line_pressure_MPa", "up to 20 MPa")),
    "noise in Pa": ("MPa = 0.15", "MPa = 150000", ("noise.line_pressure_MPa", "up to 20 MPa")),
    "endless noise": ("MPa = 0.15", "MPa = inf", ("noise.line_pressure_MPa", "up to 20 MPa")),
    "status too often": (
        "status_period_ms = 100",
        "status_period_ms = 0.1",
        ("outputs.status_period_ms", "10 to 10000 ms"),
    ),
    "gap too long": ("event_gap_ms = 10", "event_gap_ms = 100", ("learning.event_gap_ms", "2 to 50 ms")),
    "a choice that is none": (
        'meaning = "instant"',
        'meaning = "average"',
        ("sampling.meaning", '"instant"', '"mean"'),
    ),
    "training that is none": (
        "enabled = true",
        'training = "papers"',
        ("learning.training", '"prediction_error"', '"paper"'),
    ),
    "training without its gain": (
        "enabled = true",
        'training = "paper"',
        ("learning", "identification_gain"),
    ),
    # results
    "unknown result": ('"InjectionRate"', '"Rates"', ("outputs.injection_rate", "InjectionRate")),
    "message of an input for results": (
        '"InjectionRate"',
        '"SampleBlock"',
        ("outputs.injection_rate",),
    ),
    "identifier of an input": (
        "injector_id = 1",
        "injection_rate_id = 0x100",
        ("outputs.injection_rate_id", "SampleBlock and InjectionRate share 0x100"),
    ),
    "identifier of another result": (
        "injector_id = 1",
        "injection_rate_id = 0x201",
        ("outputs.injection_rate_id", "share 0x201"),
    ),
    "identifier beyond CAN": (
        "injector_id = 1",
        "status_id = 0x20000000",
        ("outputs.status_id", "0 to 536870911"),
    ),
    "one message for two results": (
        "injector_id = 1",
        'status = "InjectionSummary"',
        ("outputs", "share the message InjectionSummary", "give each its own"),
    ),
    # files
    "no such injector file": (
        "[noise]",
        '[model]\nfile = "injector.toml"\n[noise]',
        ("bench.toml: model.file", "injector.toml does not exist"),
    ),
    "a folder for the injector file": (
        "[noise]",
        '[model]\nfile = "."\n[noise]',
        ("bench.toml: model.file", "folder"),
    ),
    "a database for the injector file": (
        "[noise]",
        '[model]\nfile = "bench.toml"\n[noise]',
        ("bench.toml: link: unknown key", "fluid"),
    ),
    "state in no folder": (
        "[noise]",
        '[state]\nfile = "nowhere/learned.json"\n[noise]',
        ("bench.toml: state.file", "no such folder"),
    ),
    "journal in no folder": (
        "[noise]",
        '[state]\njournal = "nowhere/journal.sqlite"\n[noise]',
        ("bench.toml: state.journal", "no such folder"),
    ),
    "state and journal in one file": (
        "[noise]",
        '[state]\nfile = "kept"\njournal = "kept"\n[noise]',
        ("bench.toml: state.journal", "another"),
    ),
    "state in the bench file": (
        "[noise]",
        '[state]\nfile = "bench.toml"\n[noise]',
        ("bench.toml: state.file",),
    ),
    "saved at no time": (
        "[noise]",
        "[state]\nsave_within_s = 0\n[noise]",
        ("state.save_within_s", "0.1 to 3600 s"),
    ),
    # recordings
    "column without a name": (
        "[noise]",
        f"{RECORDING}line_pressure = {{}}\n[noise]",
        ("line_pressure.column",),
    ),
    "unit of a column": (
        "[noise]",
        f'{RECORDING}line_pressure = {{ column = "q", unit = "furlong" }}\n[noise]',
        ("recording.line_pressure", "'furlong'", "MPa"),
    ),
    "two separators": (
        "[noise]",
        f'{RECORDING}{RECORDED_LINE}separator = ";;"\n[noise]',
        ("recording.separator", "one character"),
    ),
    "separator and decimal alike": (
        "[noise]",
        f'{RECORDING}{RECORDED_LINE}separator = ","\ndecimal = ","\n[noise]',
        ("recording", "decimal"),
    ),
    "factor of nothing": (
        "[noise]",
        f'{RECORDING}line_pressure = {{ column = "q", factor = 0 }}\n[noise]',
        ("recording.line_pressure", "factor"),
    ),
    # several injectors
    "results of two injectors alike": ("[sampling]", f"{TWO}[sampling]", ("injectors", "give each its own")),
    "step of identifiers": (
        "[learning]",
        f"injection_rate_id = 0x300\nid_step = 0\n{TWO}[learning]",
        ("outputs.id_step", "whole numbers"),
    ),
    "key that is not an injector's": (
        "[sampling]",
        "[injectors.left.link]\nfd = true\n[sampling]",
        ("injectors.left.link",),
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_named_and_does_not_start(command: Command, tmp_path: Path, mistake: str) -> None:
    old, new, words = MISTAKES[mistake]
    assert old in BENCH
    path = tmp_path / "bench.toml"
    path.write_text(BENCH.replace(old, new, 1), encoding="utf-8")
    checked = command("check", "--bench", path)
    assert checked.code in (1, 2)
    said = checked.err if checked.code == 2 else " ".join(checked.out.split())
    assert checked.code == 1 or "remedy: " in said
    for word in words:
        assert word in said
    assert command.refused("run", "--bench", path)


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
