"""Signals that a database repeats: KCD states them in each group of a multiplexer that has them."""

from pathlib import Path

import pytest

from observer_rt.bus.database.catalogue import load_database
from observer_rt.bus.database.multiplexing import Condition, conditions_of
from observer_rt.foundation.errors import UserError

NAMESPACE = "http://kayak.2codeornot2code.org/1.0"


def kcd(folder: Path, second: str) -> Path:
    """A message with a multiplexer of two groups; `second`: the signal of the other one."""
    path = folder / "user.kcd"
    path.write_text(
        f'<NetworkDefinition xmlns="{NAMESPACE}"><Document/><Bus name="b"><Message id="0x100" length="8" name="M">'
        '<Multiplex name="Mux" offset="0" length="8">'
        '<MuxGroup count="0"><Signal name="A" offset="8" length="8"/></MuxGroup>'
        f'<MuxGroup count="3">{second}</MuxGroup></Multiplex></Message></Bus></NetworkDefinition>'
    )
    return path


def test_a_signal_of_several_groups_is_in_the_frames_of_all(tmp_path: Path) -> None:
    (message,) = load_database(kcd(tmp_path, '<Signal name="A" offset="8" length="8"/>')).messages
    assert conditions_of(message, "A") == {Condition("Mux", frozenset({0, 3}))}


def test_a_signal_that_is_defined_in_two_ways_is_refused(tmp_path: Path) -> None:
    (message,) = load_database(kcd(tmp_path, '<Signal name="A" offset="16" length="8"/>')).messages
    with pytest.raises(UserError, match="message M, signal A: is defined 2 times, in different ways"):
        conditions_of(message, "A")
