"""J1939: received frames get the identifiers of the database by their parameter groups."""

from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.can_frame import GroupIdentifier, ParameterGroups

TO_ALL, ADDRESSED = 0x18FEF1FE, 0x0CEF_21FE


@given(st.integers(0, 7), st.integers(0, 255), st.integers(0, 255))
def test_priority_address_and_destination_do_not_count(priority: int, source: int, destination: int) -> None:
    for identifier in (TO_ALL, ADDRESSED):
        groups = ParameterGroups([GroupIdentifier(identifier), 0x100])
        received = identifier & 0x03FF_FF00 | priority << 26 | source
        assert groups.own(received) == identifier
    received = priority << 26 | 0x00EF_0000 | destination << 8 | source
    assert ParameterGroups([GroupIdentifier(ADDRESSED)]).own(received) == ADDRESSED


@given(st.integers(0, 0x1FFFFFFF))
def test_other_groups_stay_as_they_are(identifier: int) -> None:
    own = ParameterGroups([GroupIdentifier(TO_ALL)]).own(identifier)
    assert own == (TO_ALL if identifier >> 8 & 0x3FFFF == 0xFEF1 else identifier)


def test_one_source_counts_and_that_of_the_database_goes_before() -> None:
    groups = ParameterGroups([GroupIdentifier(TO_ALL)])
    first, second = 0x18FEF100, 0x18FEF103
    assert [groups.own(n) for n in (first, second, first)] == [TO_ALL, second, TO_ALL]
    assert (groups.sender(TO_ALL), groups.left_out) == (0x00, {TO_ALL: {0x03}})
    assert [groups.own(n) for n in (TO_ALL, first, second, TO_ALL)] == [TO_ALL, first, second, TO_ALL]
    assert (groups.sender(TO_ALL), groups.left_out) == (0xFE, {TO_ALL: {0x00, 0x03}})


def test_identifiers_that_are_no_groups_are_taken_exactly() -> None:
    groups = ParameterGroups([TO_ALL])
    assert not groups
    assert groups.own(0x18FEF100) == 0x18FEF100
