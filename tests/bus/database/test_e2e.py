"""End-to-end protection against the package autosar-e2e, every way a frame can be damaged, and the state machine."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import e2e.p01
import e2e.p05
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.bus.database.lookup import protection_of
from observer_rt.core.frames import frames as core_frames

DATA_ID = 0x0100


class E2EStatus(IntEnum):
    OK = 0
    OK_SOME_LOST = 1
    REPEATED = 2
    WRONG_SEQUENCE = 3
    CRC_ERROR = 4
    LENGTH_ERROR = 5
    INITIAL = 6


def frame_of(payload: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(payload, np.uint8).copy()


def worth_of(frame: NDArray[np.uint8], length: int, row: np.void, last: int = -1) -> E2EStatus:
    """Worth of a frame of a message of so many bytes, padded to it; last: counter of the one before, if any."""
    message, supervised = np.zeros(1, core_frames.INPUT_MESSAGE), np.zeros(1, core_frames.SUPERVISION)
    message["length"], message["padded_length"], message["protection"] = length, frame.size, row
    supervised["counter"] = last
    return E2EStatus(core_frames.status_of_frame(frame, message, supervised))


def frame_with(row: np.void, counter: int) -> NDArray[np.uint8]:
    frame = frame_of(bytes(8))
    core_frames.protect_frame(frame, 8, row, counter)
    return frame


@pytest.mark.parametrize(
    ("profile", "modulus", "most"), [(core_frames.PROFILE_1, 15, 7), (core_frames.PROFILE_5, 256, 15)]
)
def test_every_counter_boundary(profile: int, modulus: int, most: int) -> None:
    row = protection_of(profile, DATA_ID)
    frames = [frame_with(row, counter) for counter in range(modulus)]
    for last in range(modulus):
        assert worth_of(frames[last], 8, row) is E2EStatus.INITIAL  # whatever the first counter is
        status = [worth_of(frames[(last + d) % modulus], 8, row, last) for d in range(modulus)]
        assert status[:2] == [E2EStatus.REPEATED, E2EStatus.OK]
        assert status[2 : most + 1] == [E2EStatus.OK_SOME_LOST] * (most - 1)
        assert status[most + 1 :] == [E2EStatus.WRONG_SEQUENCE] * (modulus - 1 - most)


@dataclass(frozen=True)
class Reference:
    """A profile as the package autosar-e2e has it, for frames of so many bytes whose count comes round."""

    profile: int
    lengths: tuple[int, int]
    modulus: int
    count: Callable[[bytearray, int], None]
    protect: Callable[[bytearray, Any], None]
    check: Callable[[bytes, Any], bool]

    def protected(self, payload: bytes, data_id: int, counter: int) -> bytes:
        made = bytearray(payload)
        self.count(made, counter)
        self.protect(made, data_id)
        return bytes(made)


def is_good(frame: NDArray[np.uint8], length: int, row: np.void) -> bool:
    return worth_of(frame, length, row) is not E2EStatus.CRC_ERROR


REFERENCES = {
    "1": Reference(
        core_frames.PROFILE_1,
        (2, 8),
        15,
        lambda made, counter: made.__setitem__(1, made[1] & 0xF0 | counter),
        lambda made, own: e2e.p01.e2e_p01_protect(made, own, length=len(made), increment_counter=False),
        lambda payload, own: e2e.p01.e2e_p01_check(bytearray(payload), own, length=len(payload)),
    ),
    "5": Reference(
        core_frames.PROFILE_5,
        (3, 64),
        256,
        lambda made, counter: made.__setitem__(2, counter),
        lambda made, own: e2e.p05.e2e_p05_protect(made, own, length=len(made), increment_counter=False),
        lambda payload, own: e2e.p05.e2e_p05_check(payload, own, length=len(payload)),
    ),
}


@pytest.mark.parametrize("name", REFERENCES)
@given(data=st.data(), number=st.integers(0, 0xFFFFFFFF))
def test_a_profile_is_that_of_the_reference(name: str, data: st.DataObject, number: int) -> None:
    """Whatever comes in, what goes out, and with any bit flipped on the way."""
    reference = REFERENCES[name]
    payload = data.draw(st.binary(min_size=reference.lengths[0], max_size=reference.lengths[1]))
    data_id = data.draw(st.integers(0, 0xFFFF))
    frame, length, row = frame_of(payload), len(payload), protection_of(reference.profile, data_id)
    assert is_good(frame, length, row) == reference.check(payload, data_id)
    core_frames.protect_frame(frame, length, row, number)
    assert frame.tobytes() == reference.protected(payload, data_id, number % reference.modulus)
    assert is_good(frame, length, row)
    assert worth_of(frame, length, row, number % reference.modulus) is E2EStatus.REPEATED
    assert not is_good(frame, length, protection_of(reference.profile, data_id ^ 1))
    assert is_good(frame_of(frame.tobytes() + b"\xaa"), length, row)  # what follows does not count
    for wrong in (reference.lengths[0] - 1, length + 1):  # shorter than its protection, beyond the frame
        assert not is_good(frame, wrong, row)
    for bit in range(8 * length):
        frame[bit // 8] ^= 1 << (bit % 8)
        assert is_good(frame, length, row) == reference.check(frame.tobytes(), data_id), f"bit {bit}"
        frame[bit // 8] ^= 1 << (bit % 8)


# A frame of 8 bytes for each, where the counter of the one before was 7.
COUNTERS = dict(zip(E2EStatus, (8, 9, 7, 107, 0, 0, 0), strict=True))
FRAMES = {
    status: frame_with(protection_of(core_frames.PROFILE_5, DATA_ID), counter) for status, counter in COUNTERS.items()
}
FRAMES |= {E2EStatus.CRC_ERROR: frame_of(bytes(8)), E2EStatus.LENGTH_ERROR: frame_of(bytes(9))}
GOOD = (E2EStatus.OK, E2EStatus.OK_SOME_LOST, E2EStatus.INITIAL)
BAD = (E2EStatus.CRC_ERROR, E2EStatus.LENGTH_ERROR)


class StateMachine:
    """AUTOSAR's E2E_SM, written down plainly: counts a window of statuses anew at every frame."""

    def __init__(self, window: int, min_ok: list[int], max_errors: list[int]) -> None:
        self.state = core_frames.E2EState.NODATA
        self._last = deque[E2EStatus](maxlen=window)
        self._min_ok, self._max_errors = min_ok, max_errors

    def take(self, status: E2EStatus) -> None:
        if self.state is core_frames.E2EState.NODATA:
            self.state = core_frames.E2EState.NODATA if status in BAD else core_frames.E2EState.INIT
            return
        self._last.append(status)
        is_enough = sum(each in GOOD for each in self._last) >= self._min_ok[self.state]
        is_too_wrong = sum(each in BAD for each in self._last) > self._max_errors[self.state]
        if is_enough and not is_too_wrong:
            self.state = core_frames.E2EState.VALID
        elif self.state is core_frames.E2EState.VALID or (self.state is core_frames.E2EState.INIT and is_too_wrong):
            self.state = core_frames.E2EState.INVALID


@given(
    st.integers(1, 62),
    st.lists(st.integers(0, 10), min_size=4, max_size=4),
    st.lists(st.integers(0, 10), min_size=4, max_size=4),
    st.lists(st.sampled_from(E2EStatus), min_size=1, max_size=200),
)
def test_states_are_those_of_the_plain_state_machine(
    window: int, min_ok: list[int], max_errors: list[int], statuses: list[E2EStatus]
) -> None:
    message, memory = np.zeros(1, core_frames.INPUT_MESSAGE), np.zeros(1, core_frames.SUPERVISION)
    message["length"] = message["padded_length"] = 8
    message["protection"] = protection_of(core_frames.PROFILE_5, DATA_ID)
    memory["window"], memory["min_ok"], memory["max_errors"] = window, min_ok, max_errors
    plain = StateMachine(window, min_ok, max_errors)
    for status in statuses:
        memory["counter"] = -1 if status is E2EStatus.INITIAL else 7
        assert core_frames.status_of_frame(FRAMES[status], message, memory) == status
        plain.take(status)
        assert memory["state"][0] == plain.state


def test_an_unprotected_frame_stays_as_it_is() -> None:
    frame = frame_of(bytes(range(8)))
    core_frames.protect_frame(frame, 8, protection_of(core_frames.UNPROTECTED, DATA_ID), 3)
    assert frame.tobytes() == bytes(range(8))
    assert worth_of(frame, 8, protection_of(core_frames.UNPROTECTED, DATA_ID)) is E2EStatus.OK
