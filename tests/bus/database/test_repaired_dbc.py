"""Databases with parts that decoding does not need, or identifiers that cannot be: read leniently, and reported."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.database.catalogue import load_database, overlooked_faults, repaired_dbc
from observer_rt.foundation.errors import UserError
from tests.bus.database.random_databases import RandomMessage, multiplexed_messages, plain_messages

ODD = """VERSION ""
BU_: Device
BO_ 100 Plain: 8 Device
 SG_ A : 0|8@1+ (1,0) [0|0] "" Device

BO_ 416727056 Wide: 8 Device
 SG_ B : 0|8@1+ (1,0) [0|0] "" Device
 SG_ C : 8|32@1- (1,0) [0|0] "" Device

BO_ 1073743417 Impossible: 8 Device
 SG_ D : 0|8@1+ (1,0) [0|0] "" Device

CM_ SG_ 416727056 B "BO_ 416727056 is its message; VAL_ 100 A";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 416727056 5;
VAL_ 100 A 1 "one; two" 0 "zero" ;
VAL_ 100 Absent 1 "one; \\" two"
  0 "zero" ;
VAL_ 416727056 B 7 "seven" ;
VAL_ 999 A 7 "seven" ;
VAL_ 1073743417 D 7 "seven" ;
SIG_VALTYPE_ 416727056 C : 1;
SIG_VALTYPE_ 999 C : 1;
"""
KEPT = "BO_ 101 is its message; VAL_ 100 A"  # a comment


def test_what_decoding_does_not_need_is_left_out_and_told(tmp_path: Path) -> None:
    path = tmp_path / "odd.dbc"
    path.write_text(ODD)
    with pytest.raises(
        UserError, match=r"(?s)odd.dbc:6: Standard frame id .*, or read it all the same: lenient = true"
    ):
        load_database(path)
    database = load_database(path, lenient=True)
    assert [message.name for message in database.messages] == ["Plain", "Wide"]
    plain, wide = database.messages
    assert dict(plain.signals[0].choices) == {0: "zero", 1: "one; two"}
    assert (wide.frame_id, wide.is_extended_frame, wide.cycle_time) == (416727056, True, 5)
    first, second = wide.signals
    assert dict(first.choices) == {7: "seven"}
    assert first.comment == KEPT.replace("101", "416727056")
    assert second.conversion.is_float
    assert overlooked_faults(path) == [
        "message Wide: its standard identifier 0x18D6C010 is more than 11 bits: it is taken as extended",
        "message Impossible: its standard identifier 0x40000639 is more than 11 bits: the message is left out",
        "VAL_ 100 Absent: there is no such signal, it is left out",
        "VAL_ 999 A: there is no such signal, it is left out",
        "VAL_ 1073743417 D: there is no such signal, it is left out",
        "SIG_VALTYPE_ 999 C: there is no such signal, it is left out",
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_units_are_read_in_the_encodings_of_editors(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "edited.dbc"
    path.write_text(
        ODD.split("\nBO_ 416727056")[0]
        .replace('""\n', '""\nBS_: 500000 : 1,2\n', 1)
        .replace('"" Device', '"µm" Device'),
        encoding,
    )
    assert load_database(path).messages[0].signals[0].unit == "µm"


def test_a_default_without_quotes_is_told(tmp_path: Path) -> None:
    path = tmp_path / "odd.dbc"
    path.write_text(ODD.split("\nBO_ 416727056")[0] + 'BA_DEF_ BO_ "Sent" STRING ;\nBA_DEF_DEF_ "Sent" false;\n')
    with pytest.raises(UserError, match=r"odd.dbc:6: Invalid syntax(?s:.*)lenient = true"):
        load_database(path)
    assert load_database(path, lenient=True).dbc.attribute_definitions["Sent"].default_value == "false"
    assert overlooked_faults(path) == ['BA_DEF_DEF_ "Sent" false;: "false" is meant']


@pytest.mark.parametrize(
    ("before", "comment"),
    [
        (" SG_ A", 'CM_ BO_ 100 "of the message; CM_ too";'),
        (" SG_ A", 'CM_ SG_ 100 A "two";\nCM_ "three,\nlines";'),
        ("BA_DEF_ ", 'CM_ SG_ 100 A "say "low" to it";'),
        ("BA_DEF_ ", 'CM_ SG_ 100 A "without an end'),
        ("BA_DEF_ ", 'CM_ 100 "of what?\nnobody knows";'),
        ("BO_ 100", "CM_ BO_ 100;"),
    ],
)
def test_a_comment_refuses_no_database(tmp_path: Path, before: str, comment: str) -> None:
    path = tmp_path / "odd.dbc"
    text = ODD.replace("BO_ 416727056 Wide", "BO_ 101 Wide").replace("416727056", "101").replace("1073743417", "102")
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith(("VAL_", "  0", "SIG_V")))
    path.write_text(text.replace(before, f"{comment}\n{before}", 1))
    with pytest.raises(UserError, match="lenient = true"):
        load_database(path)
    comments = [signal.comment for frame in load_database(path, lenient=True).messages for signal in frame.signals]
    assert comments == [None, "BO_ 101 is its message; VAL_ 100 A", None, None]
    assert overlooked_faults(path) == [f"{comment.splitlines()[0]}: this comment is left out"]


def test_the_reason_why_leniency_does_not_help_is_said_too(tmp_path: Path) -> None:
    path = tmp_path / "odd.dbc"
    overlapping = ODD.replace("\n\nBO_ 416727056", '\n SG_ A2 : 7|8@1+ (1,0) [0|0] "" Device\n\nBO_ 416727056', 1)
    path.write_text(overlapping.replace("8|32@1-", "8|0@1-"))
    with pytest.raises(UserError) as raised:
        load_database(path)
    assert raised.value.location == f"{path}:5"
    assert raised.value.problem == (
        "The signals A2 and A are overlapping in message Plain; and, where that is overlooked: "
        "The signal C length 0 is not greater than 0 in message Wide"
    )
    assert "lenient" not in raised.value.remedy


@given(message=plain_messages() | multiplexed_messages(), ends=st.sampled_from(("\n", "\r\n")))
def test_a_correct_database_stays_as_it_is(message: RandomMessage, ends: str) -> None:
    text = message.text().replace("\n", ends)
    assert repaired_dbc(text) == (text, ())


@given(st.text(alphabet='BOSGVAL_ 0123456789:|@+"\\;\nab', max_size=300))
def test_any_text_is_answered(text: str) -> None:
    repaired_dbc(f'BO_ 5000 A: 8 X\n SG_ B : 0|8@1+ (1,0) [0|0] "" X\n{text}')
