"""Frame times against counted bits and a simulation of the stuffing."""

import numpy as np
import pytest

from observer_rt.bus.can_frame import BITS_PER_STUFF_BIT, frame_time


@pytest.mark.parametrize(("length", "stuffed", "checksum", "fixed_stuff_bits"), [(64, 517, 25, 7), (16, 133, 21, 6)])
def test_bits_sent_at_the_data_bit_rate(length: int, stuffed: int, checksum: int, fixed_stuff_bits: int) -> None:
    """ESI, DLC and data; stuff count and CRC; fixed stuff bits; CRC delimiter."""
    at_1m, at_2m = (frame_time(length, True, 500e3, rate, False) for rate in (1e6, 2e6))
    assert (at_1m - at_2m) * 2e6 == pytest.approx(stuffed * 31 / 30 + checksum + fixed_stuff_bits + 1)


def test_expected_stuffing_is_that_of_random_bits() -> None:
    run, last, stuff_bits, bits = 0, -1, 0, 300_000
    for bit in np.random.default_rng(5).integers(0, 2, bits).tolist():
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuff_bits += 1
            run, last = 1, 1 - bit
    assert bits / stuff_bits == pytest.approx(BITS_PER_STUFF_BIT, rel=0.03)


def test_a_classic_frame_lies_between_no_and_worst_stuffing() -> None:
    """An 8-byte frame has 111 bits with intermission, 34 + 64 of them stuffed: at worst 24 stuff bits."""
    assert 111e-6 * 2 < frame_time(8, False, 500e3, 500e3, False) < 135e-6 * 2
    assert frame_time(8, False, 500e3, 8e6, False) == frame_time(8, False, 500e3, 1e6, False)


def test_extended_identifiers_cost_arbitration_bits() -> None:
    fd = frame_time(64, True, 500e3, 2e6, True) - frame_time(64, True, 500e3, 2e6, False)
    assert fd == pytest.approx(19 * 31 / 30 / 500e3)
    classic = frame_time(8, False, 500e3, 2e6, True) - frame_time(8, False, 500e3, 2e6, False)
    assert classic == pytest.approx(20 * 31 / 30 / 500e3)


def test_fd_lengths_are_padded() -> None:
    assert frame_time(49, True, 500e3, 2e6, False) == frame_time(64, True, 500e3, 2e6, False)
    assert frame_time(48, True, 500e3, 2e6, False) < frame_time(49, True, 500e3, 2e6, False)


@pytest.mark.parametrize(("length", "is_fd"), [(9, False), (65, True), (-1, True)])
def test_impossible_lengths(length: int, is_fd: bool) -> None:
    with pytest.raises(ValueError, match=f"holds {length} bytes"):
        frame_time(length, is_fd, 500e3, 2e6, False)
