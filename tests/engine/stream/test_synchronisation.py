"""When x^ follows x~, when it runs open loop, how long outputs are not available after a break."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import LOOK_BACK, Break
from observer_rt.engine.stream.state import Reason, State
from tests.engine.sample_stream import NOMINAL, Channels, Stream, at_rest, lift_with
from tests.model.conftest import with_line

MS = 100  # samples at 100 kHz


def noisy(length: int, openings: dict[int, int], seed: int = 1) -> Channels:
    """Rail, lift, line with the nominal noise; the line stands still, whatever the needle does."""
    rail, lift, line = at_rest(np.random.default_rng(seed), length)
    return rail, lift + lift_with(length, openings), line


def test_shut_for_three_milliseconds_the_observer_follows_the_identification() -> None:
    rows = Stream().feed(*noisy(3000, {1000: 110})).rows
    opened = np.flatnonzero(rows["seat_area"] > 0.0)
    opening, shut = int(opened[0]), int(opened[-1]) + 1
    assert 1000 - LOOK_BACK <= opening <= 1000
    follows = (rows["x_hat"] == rows["x_tilde"]).all(axis=1)
    assert follows[3 * MS + 1 : opening].all()
    assert not follows[opening + 1 : shut + 3 * MS].any()
    assert follows[shut + 3 * MS + 1 : 2990].all()
    assert (rows["x_hat"][shut + 3 * MS + 1 :, 2] == 0.0).all()  # the sac is at chamber pressure
    assert (rows["injection_rate"][shut + 3 * MS + 1 :] == 0.0).all()


def test_open_loop_sees_no_line_pressure() -> None:
    """From the opening on x^ is the same whatever the line sensor says; x~ is not."""
    rail, lift, line = noisy(1500, {1000: 110})
    other = line.copy()
    other[1000:] += 3e6
    rows, others = Stream().feed(rail, lift, line).rows, Stream().feed(rail, lift, other).rows
    np.testing.assert_array_equal(rows["x_hat"][:1400], others["x_hat"][:1400])
    assert np.abs(rows["x_tilde"] - others["x_tilde"])[1050:1100, 0].min() > 1e-3


@pytest.mark.parametrize(("swing", "wait"), [(0.0, MS), (3e6, 3 * MS + 1)])
def test_start_is_available_after_a_millisecond_of_standstill(swing: float, wait: int) -> None:
    """A line that does not ring: the needle was shut before. Else three milliseconds of it must be seen."""
    rail, lift, line = noisy(1000, {})
    line += swing * np.sin(2 * np.pi * 1280 * np.arange(1000) / 100e3)
    rows = Stream().feed(rail, lift, line).rows
    available = np.flatnonzero(~np.isnan(rows["injection_rate"]))
    assert available[0] == wait
    assert (rows["state"][: available[0]] == State.STARTING).all()
    assert (rows["reason"][: available[0]] == Reason.STARTING).all()
    assert (rows["state"][available[0] :] == State.RUNNING_NOMINAL).all()


def test_start_in_the_middle_of_an_injection() -> None:
    rail, lift, line = noisy(1000, {0: 200})
    rows = Stream().feed(rail, lift, line).rows
    assert np.isnan(rows["injection_rate"][: 200 + 3 * MS]).all()
    assert not np.isnan(rows["injection_rate"][200 + 3 * MS + 5 :]).any()


@pytest.mark.parametrize(
    ("broken", "reason"), [(Break.LOSS, Reason.SAMPLES_LOST), (Break.RESTART, Reason.DEVICE_RESTARTED)]
)
def test_after_a_gap_outputs_come_back_after_three_milliseconds_shut(broken: Break, reason: Reason) -> None:
    """The needle may have moved meanwhile: nothing is known of the sac."""
    stream = Stream(events_required=0).feed(*noisy(1000, {}))
    stream.feed(*noisy(1000, {}, seed=2), index=0 if broken is Break.RESTART else 1009, broken=broken)
    after = stream.rows[1000:]
    assert np.isnan(after["injection_rate"][: 3 * MS + 1]).all()
    assert not after["valid"][: 3 * MS + 1].any()
    assert (after["reason"][: 3 * MS + 1] == reason).all()
    assert (after["state"][: 3 * MS + 1] == State.DEGRADED).all()
    assert after["valid"][3 * MS + 1 :].all()
    assert (after["state"][3 * MS + 1 :] == State.RUNNING_NOMINAL).all()


def test_after_a_gap_an_early_opening_keeps_outputs_away() -> None:
    stream = Stream(events_required=0).feed(*noisy(1000, {}))
    stream.feed(*noisy(2000, {200: 110}, seed=2), index=1009, broken=Break.LOSS)
    after = stream.rows[1000:]
    assert np.isnan(after["injection_rate"][: 310 + 3 * MS - 2]).all()
    assert after["valid"][310 + 3 * MS + 5 :].all()


def test_after_a_legal_jump_one_millisecond_is_enough() -> None:
    """A windowed source jumps with a shut needle, which stays shut in between."""
    stream = Stream(events_required=0).feed(*noisy(1000, {}))
    stream.feed(*noisy(1000, {}, seed=2), index=6000, broken=Break.JUMP)
    after = stream.rows[1000:]
    assert np.isnan(after["injection_rate"][: MS - 1]).all()
    assert after["valid"][MS + 1 :].all()
    assert (after["state"] == State.RUNNING_NOMINAL).all()
    assert (after["reason"][: MS - 1] == Reason.JUMPED).all()


def test_jump_within_the_ring_down_waits_for_its_end() -> None:
    """Shut for 1 ms before the jump and 1 ms after it: the time in between counts."""
    stream = Stream(events_required=0).feed(*noisy(1000, {800: 100}))
    stream.feed(*noisy(1000, {}, seed=2), index=1050, broken=Break.JUMP)
    after = stream.rows[1000:]
    available = int(after["index"][np.flatnonzero(after["valid"])[0]])
    assert 900 + 3 * MS - 3 <= available <= 900 + 3 * MS + 3


@pytest.mark.parametrize("broken", [Break.LOSS, Break.JUMP, Break.RESTART])
def test_identification_starts_anew_after_a_break(broken: Break) -> None:
    """At p_L = y with no flow, and forgets a wrong start as fast as at the very beginning."""
    stream = Stream().feed(*noisy(1000, {}))
    rail, lift, line = noisy(1000, {}, seed=2)
    stream.feed(rail, lift, line, index=5000, broken=broken)
    pressure = (line[0] - 5e6) / 100e6
    assert tuple(stream.rows[1000]["x_tilde"]) == pytest.approx((pressure, 0.0, 0.0), abs=1e-12)
    np.testing.assert_array_equal(stream.rows["x_tilde"][1000:], Stream().feed(rail, lift, line).rows["x_tilde"])


def test_positions_and_indices_of_every_sample_stay_together() -> None:
    """Nothing is processed twice or left out over breaks, and nothing waits for ever."""
    stream = Stream()
    expected: list[int] = []
    for k, broken in enumerate([Break.NONE, Break.LOSS, Break.JUMP, Break.RESTART, Break.LOSS]):
        index = 100 if broken is Break.RESTART else 5000 * (k + 1)
        length = (700, 3, 1, 400, 2)[k]
        stream.feed(*noisy(length, {}, seed=k), index=index, broken=broken)
        expected += range(index, index + length)
    stream.finish()
    assert stream.rows["index"].tolist() == expected


def test_each_observer_steps_its_own_model() -> None:
    lines = (NOMINAL, *(with_line(NOMINAL, model="wave", cells=cells) for cells in (5, 9)))
    streams = [Stream(line).stay_shut(2e-3) for line in lines]
    assert [stream.rows["x_hat"].shape[1] for stream in streams] == [
        stream.observer.constants.coefficients.states for stream in streams
    ]
    for stream in streams:
        assert abs(stream.rows["x_hat"][-1, 0] - stream.rows["line_pressure"][-1]) < 1e-9
