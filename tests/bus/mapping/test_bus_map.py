"""From bench file and bus database to arrays; refusals name location and remedy."""

from pathlib import Path

import pytest

from observer_rt.bus.database.catalogue import load_database
from observer_rt.bus.database.lookup import find_message, reserved_codes
from observer_rt.bus.mapping.bus_map import BusMap, map_bench, map_bus, shared_resources
from observer_rt.bus.mapping.output_messages import output_message, rate_message
from observer_rt.bus.mapping.output_signals import StatusValues, SummaryValues, signals_of
from observer_rt.config.bench import EXAMPLE_BENCH, PACKAGE_DATA, load_bench
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import UNPROTECTED
from observer_rt.foundation.errors import UserError
from tests.benches import attributes, own_bench
from tests.daemon.pulses import EnergizingBy as By
from tests.daemon.pulses import pulse_bench
from tests.two_injectors import two_injectors

FD_DATABASE = PACKAGE_DATA / "observer_fd.dbc"
CLASSIC_DATABASE = PACKAGE_DATA / "observer_classic.dbc"
USER_DBC = """VERSION ""
BU_: Device
BO_ 291 Daq: 24 Device
 SG_ Index : 0|32@1+ (1,0) [0|0] "" Device
 SG_ Short : 32|16@1+ (1,0) [0|0] "" Device
 SG_ Signed : 48|32@1- (1,0) [0|0] "" Device
 SG_ Steps : 80|32@1+ (2,0) [0|0] "" Device
 SG_ Rail : 112|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Rail2 : 128|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Lift : 144|16@1+ (0.1,0) [0|0] "um" Device
 SG_ Line : 160|16@1+ (0.1,0) [0|0] "torr" Device
 SG_ Bare : 176|16@1+ (0.1,0) [0|0] "" Device
BO_ 292 Guarded: 8 Device
 SG_ Index : 0|32@1+ (1,0) [0|0] "" Device
 SG_ Rail : 32|16@1+ (0.1,0) [0|0] "bar" Device
""" + attributes([291], {292: (2, 7)})


def user_map(folder: Path, **changes: str) -> BusMap:
    roles = {
        "rail_pressure": 'signal = "Rail"',
        "needle_lift": 'signal = "Lift"',
        "line_pressure": 'signal = "Line"\nunit = "bar"',
    } | changes
    signals = {
        role: ("" if "message" in lines else 'message = "Daq"\n')
        + ("" if "index" in lines else 'index = "Index"\n')
        + lines
        for role, lines in roles.items()
    }
    return map_bus(load_bench(own_bench(folder, USER_DBC, signals)))


def refusal(folder: Path, **changes: str) -> UserError:
    with pytest.raises(UserError) as refused:
        user_map(folder, **changes)
    return refused.value


def test_users_own_database(tmp_path: Path) -> None:
    bus = user_map(tmp_path)
    (message,) = bus.inputs.messages
    assert (int(message["key"]), int(message["protection"]["profile"])) == (291, UNPROTECTED)
    assert int(message["samples"]) == 1
    (group,) = bus.inputs.groups
    assert group["factor"].tolist() == [1e5, 1e-6, 1e5]


@pytest.mark.parametrize(
    ("changes", "location", "problem", "remedy"),
    [
        ({"line_pressure": 'signal = "Line"'}, "line_pressure", "torr", "bar"),
        ({"line_pressure": 'signal = "Bare"'}, "line_pressure", "no unit", 'unit = "..."'),
        ({"line_pressure": 'signal = "Line"\nindex = "Second"'}, "line_pressure.index", "Daq", "the same"),
        (
            {
                role: f'signal = "{name}"\nindex = "Indx"'
                for role, name in zip(Role, ("Rail", "Lift", "Line"), strict=True)
            },
            "rail_pressure.index",
            "sample index",
            'index = ""',
        ),
        (
            {"rail_pressure": 'message = "Guarded"\nsignal = "Rail"'},
            "rail_pressure.message",
            "is protected by E2E profile 2",
            "only the profiles 1, 5 are supported; 0 takes its frames without a check",
        ),
    ],
)
def test_what_the_database_lacks_is_named(
    tmp_path: Path, changes: dict[str, str], location: str, problem: str, remedy: str
) -> None:
    error = refusal(tmp_path, **changes)
    assert error.location == f"{tmp_path / 'bench.toml'}: signals.{location}"
    assert problem in error.problem
    assert remedy in error.remedy


@pytest.mark.parametrize("index", ["Short", "Signed", "Steps"])
def test_index_that_cannot_be_unwrapped(tmp_path: Path, index: str) -> None:
    """One that wraps after a second would read as a device that starts anew every second."""
    roles = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
    error = refusal(tmp_path, **{role: f'index = "{index}"\nsignal = "{roles[role]}"' for role in roles})
    assert error.location.endswith("signals.rail_pressure.index")
    assert "32 bits" in error.problem


def test_a_message_too_short_for_its_protection(tmp_path: Path) -> None:
    path = tmp_path / "short.dbc"
    attributes = USER_DBC[USER_DBC.index("BA_DEF_") :].replace('E2EProfile" BO_ 292 2', 'E2EProfile" BO_ 292 5')
    text = 'VERSION ""\nBU_: A\nBO_ 291 Long: 64 A\nBO_ 292 Short: 2 A\n SG_ State : 0|3@1+ (1,0) [0|0] "" A\n'
    path.write_text(text + attributes)
    with pytest.raises(UserError, match="has 2 bytes, which E2E profile 5"):
        output_message(find_message(load_database(path), "Short"), ["State"])


@pytest.mark.parametrize(
    ("message", "names", "pages"),
    [("InjectionSummary", signals_of(SummaryValues), 7), ("ObserverStatus", signals_of(StatusValues)[:-6], 12)],
)
def test_the_classic_layout_carries_what_the_fd_layout_does(message: str, names: tuple[str, ...], pages: int) -> None:
    classic = output_message(find_message(load_database(CLASSIC_DATABASE), message), names)
    assert len(classic.pages) == pages
    assert {name for page in classic.pages for name in page.names} == set(names)
    fd = find_message(load_database(FD_DATABASE), message)
    for signal in find_message(load_database(CLASSIC_DATABASE), message).signals:
        if signal.name in names:
            other = fd.get_signal_by_name(signal.name)
            assert (signal.length, signal.scale, signal.offset) == (other.length, other.scale, other.offset)
            assert reserved_codes(signal)[0] == reserved_codes(other)[0]


def test_a_rate_message_may_lack_header_signals_but_not_be_multiplexed(tmp_path: Path) -> None:
    text = 'VERSION ""\nBU_: A\nBO_ 1 Rates: 8 A\n SG_ Page M : 0|8@1+ (1,0) [0|0] "" A\n'
    text += ' SG_ InjectionRate_00 : 8|16@1+ (0.01,0) [0|0] "" A\n SG_ State MARK : 24|3@1+ (1,0) [0|0] "" A\n'
    text += ' SG_ InjectionRate_01 MARK : 32|16@1+ (0.01,0) [0|0] "" A\n'
    path = tmp_path / "rates.dbc"
    path.write_text(text.replace("MARK ", ""))
    rate = rate_message(find_message(load_database(path), "Rates"))
    assert rate.page.names == ("State", "InjectionRate_00", "InjectionRate_01")
    assert rate.samples == 2
    path.write_text(text.replace("State MARK", "State m0").replace("MARK", "m1"))
    with pytest.raises(UserError, match="multiplexed"):
        rate_message(find_message(load_database(path), "Rates"))


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("hPa", 1e2), ("mbar", 1e2), ("psi", 6894.757293168), ("98066.5 Pa", 98066.5), ("-0.5 bar", -5e4)],
)
def test_further_units_and_a_factor_of_ones_own(tmp_path: Path, unit: str, factor: float) -> None:
    bus = user_map(tmp_path, line_pressure=f'signal = "Line"\nunit = "{unit}"')
    assert bus.inputs.groups[0]["factor"].tolist() == [1e5, 1e-6, factor]


@pytest.mark.parametrize("unit", ["0 Pa", "nan Pa", "1 2 Pa", "2 apples", "1e999 Pa"])
def test_a_factor_that_is_none(tmp_path: Path, unit: str) -> None:
    error = refusal(tmp_path, line_pressure=f'signal = "Line"\nunit = "{unit}"')
    assert repr(unit) in error.problem
    assert 'or a number of them ("98066.5 Pa")' in error.remedy


def test_results_under_other_identifiers(tmp_path: Path) -> None:
    text = EXAMPLE_BENCH.read_text()
    for key, identifier in (("injection_rate", "0x300"), ("injection_summary", "0x18FF0001"), ("status", "0x7FF")):
        text = text.replace(f"# {key}_id =", f"{key}_id = {identifier} #")
    (tmp_path / "bench.toml").write_text(text)
    bus, usual = map_bus(load_bench(tmp_path / "bench.toml")), map_bus(load_bench())
    identifiers = [(layout.frame_id, layout.is_extended) for layout in bus.sent]
    assert identifiers == [(0x300, False), (0x18FF0001, True), (0x7FF, False)]
    sent = [[message.layout.name for _, message in bus.results_of(per_injection=each)] for each in (True, False)]
    assert sent == [["InjectionSummary"], ["ObserverStatus"]]
    for moved, layout in zip(bus.sent, usual.sent, strict=True):
        assert (moved.name, moved.length, moved.e2e_data_id) == (layout.name, layout.length, layout.e2e_data_id)


@pytest.mark.parametrize(
    ("old", "new", "location", "problem"),
    [
        ("SampleBlock: 64", "SampleBlock: 80", "signals.rail_pressure.message", "80 bytes, no frame more than 64"),
        ("InjectionRate: 64", "InjectionRate: 80", "outputs.injection_rate", "80 bytes, no frame more than 64"),
        ('"GenSigError" SG_ 256 LinePressure_04 65534', '"GenSigError" SG_ 256 LinePressure_04 99999',
         "signals.rail_pressure", "GenSigError is 99999, which its 16 bits cannot hold"),
    ],
)  # fmt: skip
def test_a_wrong_database_names_the_bench(tmp_path: Path, old: str, new: str, location: str, problem: str) -> None:
    text = FD_DATABASE.read_text()
    assert old in text
    (tmp_path / "observer_fd.dbc").write_text(text.replace(old, new))
    (tmp_path / "bench.toml").write_text(EXAMPLE_BENCH.read_text())
    with pytest.raises(UserError) as refused:
        map_bus(load_bench(tmp_path / "bench.toml"))
    assert refused.value.location == f"{tmp_path / 'bench.toml'}: {location}"
    assert problem in refused.value.problem


def test_a_message_that_both_read_stands_once_and_what_they_must_not_share_is_named(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    mapped = map_bench(bench)
    assert [{(layout.name, layout.bus) for layout in bus.input_layouts} for bus in mapped.injectors] == [
        {("RailPressureBlock", 0), ("NeedleLiftBlock", bus), ("LinePressureBlock", bus)} for bus in (1, 2)
    ]
    assert [(layout.name, layout.bus) for layout in mapped.sent] == [
        (name, bus) for bus in (1, 2) for name in ("InjectionRate", "InjectionSummary", "ObserverStatus")
    ]
    received = [(layout.name, layout.bus) for layout in mapped.received]
    assert len(received) == len({*received}) == 5  # one rail pressure, two lifts and line pressures
    assert [*shared_resources(bench, mapped)] == []
    path = tmp_path / "two.toml"
    text = path.read_text().replace("injector_id = 2", "injector_id = 1").replace('\nlink = "right"\ninj', "\ninj")
    path.write_text(text)
    bench = load_bench(path)
    shared = dict(shared_resources(bench, map_bench(bench)))
    assert shared == {"outputs.injector_id = 1": ["left", "right"]}


@pytest.mark.parametrize(
    ("lines", "index"), [(By.TIME, "PulseIndex"), (By.TIME_BY_STAMP, None), (By.LEVELS_IN_BLOCK, "SampleIndex")]
)
def test_commands_have_the_index_that_is_stated_or_usual(tmp_path: Path, lines: str, index: str | None) -> None:
    (injector,) = map_bench(load_bench(pulse_bench(tmp_path, lines))).injectors
    assert injector.energizing is not None
    assert injector.energizing.index == index
