"""Loading bus databases, our own layout, and errors that name the fault."""

import hashlib
import re
from importlib.resources import files
from pathlib import Path

import pytest
from cantools.database.can import Database

from observer_rt.bus.database.catalogue import load_database, overlooked_faults
from observer_rt.bus.database.lookup import MessageLayout, database_hash, find_message, reserved_codes, signal_names
from observer_rt.foundation.errors import UserError

OUR_LAYOUT = Path(str(files("observer_rt") / "data" / "observer_fd.dbc"))

PRESSURES = "\n".join(
    f' SG_ {name} : {bit}|16@0{sign} (0.1,0) [0|0] "bar" Vector__XXX'
    for name, bit, sign in (("Rail1", 7, "+"), ("Rail2", 23, "+"), ("Line1", 39, "-"), ("Line3", 55, "-"))
)
USER_DBC = f"""VERSION ""
BU_: Device
BO_ 2147484672 Pressures: 8 Device
{PRESSURES}
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "SamplesPerFrame" INT 0 64;
BA_DEF_ BO_ "E2EProfile" INT 0 22;
BA_DEF_ SG_ "GenSigSNA" STRING ;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "SamplesPerFrame" 1;
BA_DEF_DEF_ "E2EProfile" 0;
BA_DEF_DEF_ "GenSigSNA" "";
BA_ "GenMsgCycleTime" BO_ 2147484672 3;
BA_ "SamplesPerFrame" BO_ 2147484672 2;
BA_ "GenSigSNA" SG_ 2147484672 Rail1 "0xFFFF";
"""


@pytest.fixture(scope="module")
def ours() -> Database:
    return load_database(OUR_LAYOUT)


def load_text(folder: Path, text: str) -> Database:
    path = folder / "user.dbc"
    path.write_text(text)
    return load_database(path)


def test_every_message_starts_with_the_same_header(ours: Database) -> None:
    for message in ours.messages:
        header = {s.name: (s.start, s.length) for s in message.signals if s.start < 64}
        flags = {"Valid": (24, 1), "Learning": (25, 1), "State": (26, 3)} if message.frame_id >= 0x200 else {}
        named = {"ObserverStatus": {"TroubledBus": (29, 3)}, "InjectionSummary": {"Calibrated": (29, 1)}}
        own = named.get(message.name, {})
        assert header == {"CRC": (0, 16), "Counter": (16, 8), "SampleIndex": (32, 32)} | flags | own


def test_protected_messages_have_distinct_data_ids(ours: Database) -> None:
    data_ids = [MessageLayout.of(message).e2e_data_id for message in ours.messages]
    assert len(set(data_ids)) == len(ours.messages)


def test_samples_are_interleaved_in_triples(ours: Database) -> None:
    order = [signal.name for signal in find_message(ours, "SampleBlock").signals][3:]
    roles = ("RailPressure", "NeedleLift", "LinePressure")
    assert order == [f"{role}_{i:02d}" for i in range(9) for role in roles] + ["FuelTemperature"]


def test_a_users_database(tmp_path: Path) -> None:
    (longer,) = load_text(tmp_path, USER_DBC.replace("Pressures: 8", "Pressures: 12")).messages
    assert MessageLayout.of(longer).is_fd  # nothing else carries 12 bytes
    message = find_message(load_text(tmp_path, USER_DBC), "Pressures")
    layout = MessageLayout.of(message)
    assert (layout.frame_id, layout.is_extended, layout.is_fd) == (0x400, True, False)
    assert (layout.samples_per_frame, layout.cycle_time_ns) == (2, 3_000_000)
    assert layout.e2e_profile is None
    assert reserved_codes(message.get_signal_by_name("Rail1"))[0] == 0xFFFF
    assert reserved_codes(message.get_signal_by_name("Rail2"))[0] is None
    assert overlooked_faults(tmp_path / "user.dbc") == []


def test_signal_names(ours: Database, tmp_path: Path) -> None:
    block = find_message(ours, "RailPressureBlock")
    assert signal_names(block, "RailPressure_{:02d}") == tuple(f"RailPressure_{i:02d}" for i in range(28))
    assert signal_names(block, "Counter") == ("Counter",)
    assert signal_names(block, ["RailPressure_03", "RailPressure_01"]) == ("RailPressure_03", "RailPressure_01")
    users = find_message(load_text(tmp_path, USER_DBC), "Pressures")
    assert signal_names(users, "Rail{}") == ("Rail1", "Rail2")


@pytest.mark.parametrize(
    ("wanted", "said"),
    [
        ("Railpressure_{:02d}", "nearest name: RailPressure_00"),
        ("RailPressure_{:02d}_{}", "one number field"),
        (["RailPressure_00", "RailPressure_7"], "nearest name: RailPressure_07"),
        (["RailPressure_00", "RailPressure_00"], "listed twice"),
        ([], "empty"),
    ],
)
def test_wrong_signal_names(ours: Database, wanted: str | list[str], said: str) -> None:
    with pytest.raises(UserError, match=said):
        signal_names(find_message(ours, "RailPressureBlock"), wanted)


def test_signals_in_no_message_are_no_fault(tmp_path: Path) -> None:
    """CANdb++ writes such."""
    message = (
        'BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ Spare : 0|2@1+ (1,0) [0|3] "" Vector__XXX\n'
    )
    text = USER_DBC.replace("BA_DEF_ ", f"\n{message}\nBA_DEF_ ", 1) + 'VAL_ 3221225472 Spare 1 "On"\n 0 "Off" ;\n'
    assert [message.name for message in load_text(tmp_path, text).messages] == ["Pressures"]


def test_a_pattern_with_a_gap_is_refused(tmp_path: Path) -> None:
    users = find_message(load_text(tmp_path, USER_DBC), "Pressures")
    with pytest.raises(UserError, match="leaves out Line2, though Line3 exists"):
        signal_names(users, "Line{}")


def test_wrong_message_name(ours: Database) -> None:
    with pytest.raises(UserError, match="nearest name: SampleBlock"):
        find_message(ours, "sample_block")


@pytest.mark.parametrize(
    ("change", "line", "said", "may_be_lenient"),
    [
        (("Rail1 : 7|16@0+", "Rail1 : 7|16@0*"), 4, "Invalid syntax", False),
        (("Rail1 : 7|16@0+", "Rail1 : 7|17@0+"), 5, "Rail2 and Rail1 are overlapping", True),
        (("Line3 : 55|16@0-", "Line3 : 55|17@0-"), 7, "Line3 does not fit in message Pressures", True),
        (("Rail2 : 23|16@0+", "Rail2 : 23|0@0+"), 5, "Rail2 length 0 is not greater than 0", False),
        (("BO_ 2147484672 P", "BO_ 4096 P"), 3, "more than 11 bits", True),
        (("BA_DEF_DEF_", 'VAL_ 2147484672 Rail9 0 "VAL_ 2147484672 Rail1;" 1 "b" ;\nBA_DEF_DEF_'), 12, "Rail9", True),
        (("Rail2 : 23|16@0+", "Rail2 : 23|99999999@0+"), 5, r"larger than any frame: 23\|99999999", False),
        (("Pressures: 8", "Pressures: 4000000000"), 3, "larger than any frame: 4000000000", False),
        (('BA_DEF_ BO_ "GenMsgCycleTime"', 'BA_DEF_ BO_ "Other"'), 16, "uses GenMsgCycleTime", False),
    ],
)
def test_faulty_databases_are_refused_with_file_line_and_reason(
    tmp_path: Path, change: tuple[str, str], line: int | None, said: str, may_be_lenient: bool
) -> None:
    assert change[0] in USER_DBC
    text = USER_DBC.replace(*change)
    with pytest.raises(UserError, match=said) as caught:
        load_text(tmp_path, text)
    path = tmp_path / "user.dbc"
    assert caught.value.location == (str(path) if line is None else f"{path}:{line}")
    assert ("lenient = true" in caught.value.remedy) == may_be_lenient
    if may_be_lenient:
        assert find_message(load_database(path, lenient=True), "Pressures").signals
        assert any(re.search(said, complaint) for complaint in overlooked_faults(path))
    else:
        with pytest.raises(UserError, match=said):
            load_database(path, lenient=True)


@pytest.mark.parametrize(
    ("names", "codes"),
    [
        ('65535 "SNA" 65534 "Error"', (65535, 65534)),
        ('65533 "Signal not available"', (65533, None)),
        ('0 "off" 1 "on"', (None, None)),
    ],
)
def test_codes_named_in_a_value_table(tmp_path: Path, names: str, codes: tuple[int | None, int | None]) -> None:
    text = USER_DBC + f"VAL_ 2147484672 Rail2 {names} ;\n"
    signal = find_message(load_text(tmp_path, text), "Pressures").get_signal_by_name("Rail2")
    assert reserved_codes(signal) == codes


def test_missing_database(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"absent\.dbc: no such file"):
        load_database(tmp_path / "absent.dbc")
    (tmp_path / "folder.dbc").mkdir()
    with pytest.raises(UserError, match="cannot be read"):
        load_database(tmp_path / "folder.dbc")
    with pytest.raises(UserError, match=r"user\.arxml: is no DBC file\n.*canconvert user\.arxml user\.dbc"):
        load_database(tmp_path / "user.arxml")


@pytest.mark.parametrize(
    ("attribute", "said"),
    [
        ('BA_ "E2EProfile" BO_ 2147484672 5;', "no attribute E2EDataId"),
        ('BA_ "GenSigSNA" SG_ 2147484672 Rail2 "none";', "'none' is not a whole number"),
        ('BA_ "GenSigSNA" SG_ 2147484672 Rail2 "70000";', "16 bits cannot hold"),
    ],
)
def test_faulty_attributes_are_refused(tmp_path: Path, attribute: str, said: str) -> None:
    message = find_message(load_text(tmp_path, USER_DBC + attribute + "\n"), "Pressures")
    with pytest.raises(UserError, match=said):
        (MessageLayout.of(message), reserved_codes(message.get_signal_by_name("Rail2")))


def test_database_hash_is_of_the_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "1.dbc", tmp_path / "2.dbc"
    first.write_bytes(b"one")
    second.write_bytes(b"two")
    assert database_hash([first, second]) == int(hashlib.sha256(b"onetwo").hexdigest()[:8], 16)
    assert database_hash([first, second]) != database_hash([second, first])
    with pytest.raises(UserError, match=r"absent\.dbc"):
        database_hash([tmp_path / "absent.dbc"])


def test_a_label_that_no_code_of_the_signal_stands_for_is_no_error(tmp_path: Path) -> None:
    flag = ' SG_ Flag : 48|1@1+ (1,0) [0|1] "" Vector__XXX\n'
    text = USER_DBC.replace(f"{PRESSURES}\n", flag) + 'VAL_ 2147484672 Flag 2 "Error" 3 "SNA" ;\n'
    text = re.sub(r'BA_ "GenSigSNA".*\n', "", text)
    signal = load_text(tmp_path, text).messages[0].get_signal_by_name("Flag")
    assert reserved_codes(signal) == (None, None)


def test_a_message_without_signals_says_so(tmp_path: Path) -> None:
    message = find_message(load_text(tmp_path, USER_DBC.replace(f"{PRESSURES}\n", "")), "Pressures")
    with pytest.raises(UserError, match=r"has no signal Rail1\n.*it has none at all"):
        signal_names(message, "Rail1")
