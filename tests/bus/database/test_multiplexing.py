"""Signals that a database repeats, in each group of a multiplexer that has them."""

from pathlib import Path

import pytest

from observer_rt.bus.database.catalogue import load_database
from observer_rt.bus.database.multiplexing import Condition, conditions_of, frame_kinds
from observer_rt.foundation.errors import UserError


def dbc(folder: Path, second: int) -> Path:
    """A message with a multiplexer of two groups; `second`: first bit of the signal in the other one."""
    path = folder / "user.dbc"
    signals = ["Mux M : 0|8", "A m0 : 8|8", f"A m3 : {second}|8"]
    lines = "".join(f' SG_ {signal}@1+ (1,0) [0|0] "" X\n' for signal in signals)
    path.write_text(f'VERSION ""\nBU_: X\nBO_ 256 M: 8 X\n{lines}')
    return path


def test_a_signal_of_several_groups_is_in_the_frames_of_all(tmp_path: Path) -> None:
    (message,) = load_database(dbc(tmp_path, 8)).messages
    assert conditions_of(message, "A") == {Condition("Mux", frozenset({0, 3}))}


def test_a_signal_that_is_defined_in_two_ways_is_refused(tmp_path: Path) -> None:
    (message,) = load_database(dbc(tmp_path, 16)).messages
    with pytest.raises(UserError, match="message M, signal A: is defined 2 times, in different ways"):
        conditions_of(message, "A")


def test_as_few_kinds_of_frames_as_carry_all_signals_in_their_order() -> None:
    always, (first, second) = frozenset[Condition](), (frozenset({Condition("M", frozenset({k, 3}))}) for k in (1, 2))
    assert frame_kinds([]) == frame_kinds([always, always]) == ({},)
    assert frame_kinds([second, always, first, second]) == ({"M": 2}, {"M": 1})
