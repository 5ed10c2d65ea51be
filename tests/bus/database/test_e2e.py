"""End-to-end protection against the package autosar-e2e, every way a frame can be damaged, and the state machine."""

from collections import deque

import e2e.p01
import e2e.p02
import e2e.p05
import e2e.p07
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus.database.e2e import (
    DATA_IDS,
    PROFILE_1,
    PROFILE_2,
    PROFILE_5,
    PROFILE_7,
    SUPERVISION,
    UNPROTECTED,
    E2EState,
    E2EStatus,
    check,
    classify,
    crc16,
    frame_counter,
    protect,
    protection_of,
    supervise,
)

DATA_ID = 0x0100


def frame_of(payload: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(payload, np.uint8).copy()


def protected(length: int = 64, data_id: int = DATA_ID, counter: int = 7) -> NDArray[np.uint8]:
    frame = np.random.default_rng(length).integers(0, 256, length).astype(np.uint8)
    protect(frame, length, protection_of(PROFILE_5, data_id), counter)
    return frame


def test_crc_of_the_catalogue_check_string() -> None:
    """CRC-16/CCITT-FALSE of "123456789" is 0x29B1: the last two characters serve as the data id."""
    payload = frame_of(b"\0\0" + b"1234567")
    assert crc16(payload, 9, ord("8") | ord("9") << 8) == 0x29B1


@given(st.binary(min_size=3, max_size=64), st.integers(0, 0xFFFF), st.integers(0, 255))
def test_protect_equals_the_reference(payload: bytes, data_id: int, counter: int) -> None:
    frame = frame_of(payload)
    protect(frame, len(payload), protection_of(PROFILE_5, data_id), counter)
    reference = bytearray(payload)
    reference[2] = counter
    e2e.p05.e2e_p05_protect(reference, data_id, length=len(payload), increment_counter=False)
    assert frame.tobytes() == bytes(reference)
    assert e2e.p05.e2e_p05_check(frame.tobytes(), data_id, length=len(payload))


@given(st.binary(min_size=3, max_size=64), st.integers(0, 0xFFFF))
def test_check_equals_the_reference(payload: bytes, data_id: int) -> None:
    frame = frame_of(payload)
    assert check(frame, len(payload), protection_of(PROFILE_5, data_id)) == e2e.p05.e2e_p05_check(
        payload, data_id, length=len(payload)
    )
    protect(frame, len(payload), protection_of(PROFILE_5, data_id), 255)
    assert check(frame, len(payload), protection_of(PROFILE_5, data_id))


@given(st.binary(min_size=20, max_size=64), st.integers(0, 0xFFFFFFFF), st.integers(0, 0xFFFFFFFF))
def test_profile_7_equals_the_reference(payload: bytes, data_id: int, counter: int) -> None:
    frame = frame_of(payload)
    assert check(frame, len(payload), protection_of(PROFILE_7, data_id)) == e2e.p07.e2e_p07_check(
        payload, data_id
    )
    protect(frame, len(payload), protection_of(PROFILE_7, data_id), counter)
    reference = bytearray(payload)
    reference[12:16] = counter.to_bytes(4, "big")
    e2e.p07.e2e_p07_protect(reference, data_id, increment_counter=False)
    assert frame.tobytes() == bytes(reference)
    assert check(frame, len(payload), protection_of(PROFILE_7, data_id))
    assert frame_counter(frame, PROFILE_7) == counter
    assert not check(frame, len(payload), protection_of(PROFILE_7, data_id ^ 1))
    for bit in range(0, 8 * len(payload), 7):
        frame[bit // 8] ^= 1 << (bit % 8)
        assert not check(frame, len(payload), protection_of(PROFILE_7, data_id)), f"bit {bit}"
        frame[bit // 8] ^= 1 << (bit % 8)


def test_only_the_protected_length_counts() -> None:
    buffer = np.zeros(64, np.uint8)
    buffer[:48] = protected(48)
    buffer[48:] = 0xAA
    assert check(buffer, 48, protection_of(PROFILE_5, DATA_ID))
    assert not check(buffer, 64, protection_of(PROFILE_5, DATA_ID))


def test_every_single_bit_flip_is_caught() -> None:
    frame = protected()
    for bit in range(8 * 64):
        frame[bit // 8] ^= 1 << (bit % 8)
        assert not check(frame, 64, protection_of(PROFILE_5, DATA_ID)), f"bit {bit}"
        frame[bit // 8] ^= 1 << (bit % 8)
    assert check(frame, 64, protection_of(PROFILE_5, DATA_ID))


@pytest.mark.parametrize("first", range(0, 64, 9))
def test_bursts_up_to_sixteen_bits_are_caught(first: int) -> None:
    frame = protected()
    for burst in range(1, 1 << 16, 97):
        damaged = frame.copy()
        damaged[first % 63] ^= burst & 0xFF
        damaged[first % 63 + 1] ^= burst >> 8
        assert not check(damaged, 64, protection_of(PROFILE_5, DATA_ID))


def test_another_messages_frame_is_caught() -> None:
    frame = protected()
    assert not any(
        check(frame, 64, protection_of(PROFILE_5, other)) for other in range(0x10000) if other != DATA_ID
    )


def test_frames_of_the_wrong_length_fail() -> None:
    frame = protected()
    assert not check(frame, 63, protection_of(PROFILE_5, DATA_ID))
    assert not check(frame, 65, protection_of(PROFILE_5, DATA_ID))
    assert not check(frame, 2, protection_of(PROFILE_5, DATA_ID))


@pytest.mark.parametrize("last", range(256))
def test_every_counter_boundary(last: int) -> None:
    max_delta = 5
    status = [classify((last + delta) % 256, last, True, max_delta, PROFILE_5) for delta in range(256)]
    assert status[0] == E2EStatus.REPEATED
    assert status[1] == E2EStatus.OK
    assert status[2 : max_delta + 1] == [E2EStatus.OK_SOME_LOST] * (max_delta - 1)
    assert status[max_delta + 1 :] == [E2EStatus.WRONG_SEQUENCE] * (255 - max_delta)


@pytest.mark.parametrize("counter", [0, 1, 254, 255])
def test_the_first_frame_is_initial_whatever_its_counter(counter: int) -> None:
    assert classify(counter, counter, False, 1, PROFILE_5) is E2EStatus.INITIAL
    assert classify(counter, 0, False, 1, PROFILE_5) is E2EStatus.INITIAL


def test_with_the_smallest_step_no_loss_is_tolerated() -> None:
    assert classify(0, 255, True, 1, PROFILE_5) == E2EStatus.OK
    assert classify(1, 255, True, 1, PROFILE_5) == E2EStatus.WRONG_SEQUENCE


@given(st.binary(min_size=2, max_size=8), st.integers(0, 0xFFFF), st.integers(0, 100))
def test_profile_1_protects_as_the_reference(payload: bytes, data_id: int, number: int) -> None:
    frame = frame_of(payload)
    protect(frame, len(payload), protection_of(PROFILE_1, data_id), number)
    reference = bytearray(payload)
    reference[1] = payload[1] & 0xF0 | number % 15
    e2e.p01.e2e_p01_protect(reference, data_id, length=len(payload), increment_counter=False)
    assert frame.tobytes() == bytes(reference)
    assert check(frame, len(payload), protection_of(PROFILE_1, data_id))
    assert frame_counter(frame, PROFILE_1) == number % 15


@given(st.binary(min_size=2, max_size=8), st.integers(0, 0xFFFF))
def test_profile_1_checks_as_the_reference(payload: bytes, data_id: int) -> None:
    reference = bytearray(payload)
    for damaged in (True, False):
        if not damaged:
            e2e.p01.e2e_p01_protect(reference, data_id, length=len(payload), increment_counter=False)
        expected = e2e.p01.e2e_p01_check(bytearray(reference), data_id, length=len(payload))
        assert check(frame_of(bytes(reference)), len(payload), protection_of(PROFILE_1, data_id)) == expected


def test_profile_1_catches_every_flipped_bit_and_every_burst_of_eight_bits_in_the_contents() -> None:
    frame = np.arange(8, dtype=np.uint8)
    protect(frame, 8, protection_of(PROFILE_1, DATA_ID), 7)
    good = int.from_bytes(frame.tobytes(), "big")
    bursts = [burst << first for first in range(49) for burst in range(1, 256, 2)]
    for damage in (*bursts, *(1 << bit for bit in range(64))):
        assert not check(
            frame_of((good ^ damage).to_bytes(8, "big")), 8, protection_of(PROFILE_1, DATA_ID)
        ), hex(damage)


def test_profile_1_needs_two_bytes() -> None:
    assert not check(np.zeros(8, np.uint8), 1, protection_of(PROFILE_1, 0))
    assert not check(np.zeros(1, np.uint8), 2, protection_of(PROFILE_1, 0))


@pytest.mark.parametrize("last", range(15))
def test_every_counter_boundary_of_profile_1(last: int) -> None:
    status = [classify((last + delta) % 15, last, True, 7, PROFILE_1) for delta in range(15)]
    assert status[:2] == [E2EStatus.REPEATED, E2EStatus.OK]
    assert status[2:8] == [E2EStatus.OK_SOME_LOST] * 6
    assert status[8:] == [E2EStatus.WRONG_SEQUENCE] * 7


IDS = st.binary(min_size=DATA_IDS, max_size=DATA_IDS)


@given(st.binary(min_size=2, max_size=64), IDS, st.integers(0, 100))
def test_profile_2_equals_the_reference(payload: bytes, ids: bytes, number: int) -> None:
    frame, row = frame_of(payload), protection_of(PROFILE_2, ids)
    assert check(frame, len(payload), row) == e2e.p02.e2e_p02_check(payload, ids)
    protect(frame, len(payload), row, number)
    reference = bytearray(payload)
    reference[1] = payload[1] & 0xF0 | number % 16
    e2e.p02.e2e_p02_protect(reference, ids, increment_counter=False)
    assert frame.tobytes() == bytes(reference)
    assert check(frame, len(payload), row)
    assert frame_counter(frame, PROFILE_2) == number % 16
    other = bytearray(ids)
    other[number % 16] ^= 1
    assert not check(frame, len(payload), protection_of(PROFILE_2, bytes(other)))
    for bit in range(8 * len(payload)):
        frame[bit // 8] ^= 1 << (bit % 8)
        assert check(frame, len(payload), row) == e2e.p02.e2e_p02_check(frame.tobytes(), ids), f"bit {bit}"
        frame[bit // 8] ^= 1 << (bit % 8)


def crc8h2f_of(content: bytes) -> int:
    """By its definition, bit by bit."""
    crc = 0xFF
    for byte in content:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x2F if crc & 0x80 else 0)) & 0xFF
    return crc ^ 0xFF


def test_the_crc_of_profile_2_is_crc_8h2f_of_the_catalogue() -> None:
    assert crc8h2f_of(b"123456789") == 0xDF
    frame = frame_of(b"\0" + b"\x32" + b"345678")
    protect(frame, 8, protection_of(PROFILE_2, bytes(DATA_IDS)), 2)
    assert frame[0] == crc8h2f_of(b"2345678\0")


@pytest.mark.parametrize("last", range(16))
def test_every_counter_boundary_of_profile_2(last: int) -> None:
    status = [classify((last + delta) % 16, last, True, 8, PROFILE_2) for delta in range(16)]
    assert status[:2] == [E2EStatus.REPEATED, E2EStatus.OK]
    assert status[2:9] == [E2EStatus.OK_SOME_LOST] * 7
    assert status[9:] == [E2EStatus.WRONG_SEQUENCE] * 7


GOOD = (E2EStatus.OK, E2EStatus.OK_SOME_LOST, E2EStatus.INITIAL)
BAD = (E2EStatus.CRC_ERROR, E2EStatus.LENGTH_ERROR)


class StateMachine:
    """AUTOSAR's E2E_SM, written down plainly: counts a window of statuses anew at every frame."""

    def __init__(self, window: int, min_ok: list[int], max_errors: list[int]) -> None:
        self.state = E2EState.NODATA
        self._last = deque[E2EStatus](maxlen=window)
        self._min_ok, self._max_errors = min_ok, max_errors

    def take(self, status: E2EStatus) -> None:
        """One frame."""
        if self.state is E2EState.NODATA:
            self.state = E2EState.NODATA if status in BAD else E2EState.INIT
            return
        self._last.append(status)
        is_enough = sum(each in GOOD for each in self._last) >= self._min_ok[self.state]
        is_too_wrong = sum(each in BAD for each in self._last) > self._max_errors[self.state]
        if is_enough and not is_too_wrong:
            self.state = E2EState.VALID
        elif self.state is E2EState.VALID or (self.state is E2EState.INIT and is_too_wrong):
            self.state = E2EState.INVALID


@njit
def states_of(memory, statuses):  # type: ignore[no-untyped-def]
    found = np.empty_like(statuses)
    for n, status in enumerate(statuses):
        supervise(memory[0], status)
        found[n] = memory[0].state
    return found


@given(
    st.integers(1, 62),
    st.lists(st.integers(0, 10), min_size=4, max_size=4),
    st.lists(st.integers(0, 10), min_size=4, max_size=4),
    st.lists(st.sampled_from(E2EStatus), min_size=1, max_size=200),
)
def test_states_are_those_of_the_plain_state_machine(
    window: int, min_ok: list[int], max_errors: list[int], statuses: list[E2EStatus]
) -> None:
    memory = np.zeros(1, SUPERVISION)
    memory["window"], memory["min_ok"], memory["max_errors"] = window, min_ok, max_errors
    plain = StateMachine(window, min_ok, max_errors)
    expected = []
    for status in statuses:
        plain.take(status)
        expected.append(plain.state)
    assert states_of(memory, np.array(statuses, np.int64)).tolist() == expected


def test_an_unprotected_frame_stays_as_it_is() -> None:
    frame = frame_of(bytes(range(8)))
    protect(frame, 8, protection_of(UNPROTECTED, DATA_ID), 3)
    assert frame.tobytes() == bytes(range(8))
    assert check(frame, 8, protection_of(UNPROTECTED, DATA_ID))
