"""The optional input `learning_enable`: what it stops, what it leaves, and frames that say nothing of it."""

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.parameters import NOZZLE, OFFSET
from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.slow_frames import bed, safe_bed, slow_bench
from tests.device import Result, Traffic, damaged, inserted, run, simulated

ENABLE = {"learning_enable": ("Bed", "LearnEnable")}
SAFE_ENABLE = {"learning_enable": ("SafeBed", "LearnEnableSafe")}
BLOCK = 9  # samples in a frame
Words = Iterable[tuple[int, TimedFrame]]


@pytest.fixture
def with_frames(tmp_path: Path, clean: Traffic) -> Callable[..., Result]:
    """What a core makes of clean traffic and of words before the frames of some numbers; extra: of `slow_bench`."""

    def through(words: Words, roles: dict[str, tuple[str, str]] = ENABLE, extra: str = "") -> Result:
        return run(slow_bench(tmp_path, roles, extra), inserted(clean.frames, words))

    return through


def after_injection(result: Result, number: int) -> int:
    """Number of a frame that comes after the event of an injection is judged, before the next one begins."""
    following = result.reports[number].start_index  # of the next one: reports count from 0
    return following // BLOCK - 20


def flags(result: Result) -> list[int]:
    return [int(header["Learning"]) for _, header, _ in result.rate_frames]


@pytest.mark.parametrize("value", [1, 2, None])
def test_on_or_unknown_changes_nothing(clean: Traffic, with_frames: Callable[..., Result], value: int | None) -> None:
    assert with_frames((n, bed("LearnEnable", value)) for n in range(0, 1600, 100)).frames == clean.result.frames
    assert with_frames([]).frames == clean.result.frames


def test_off_from_the_start_is_as_switched_off_by_the_bench(with_frames: Callable[..., Result]) -> None:
    held = with_frames([(0, bed("LearnEnable", 0))])
    assert held.frames == with_frames([], extra="[learning]\nenabled = false").frames
    assert (set(flags(held)), held.core.counters.adoptions) == ({0}, 0)


def test_what_was_learned_stays_in_force(clean: Traffic, with_frames: Callable[..., Result]) -> None:
    """Off after the first of three events."""
    usual = clean.result
    held = with_frames([(after_injection(usual, 1), bed("LearnEnable", 0))])
    first, second, third = held.reports
    assert held.core.counters.adoptions == 1 < usual.core.counters.adoptions
    assert first.mass_ci95 == usual.reports[0].mass_ci95
    for report in (second, third):
        assert (report.mass, report.mass_ci95) == (report.live_mass, None)
        assert (report.phi_version, report.indicators[OFFSET].value) == (1, first.indicators[OFFSET].value)
        assert report.indicators[NOZZLE].value == pytest.approx(first.indicators[NOZZLE].value, rel=1e-3)
    assert third.validity == "valid, mass of the live rate, without an interval, not calibrated"
    assert [summary["Learning"] for summary in held.summaries] == [1, 0, 0]
    assert flags(held) == sorted(flags(held), reverse=True)
    assert 0 in flags(held)


@pytest.mark.parametrize("on", [1, None])
def test_learning_goes_on_when_on_again(clean: Traffic, with_frames: Callable[..., Result], on: int | None) -> None:
    result = with_frames([(0, bed("LearnEnable", 0)), (after_injection(clean.result, 1), bed("LearnEnable", on))])
    assert [report.mass_ci95 is None for report in result.reports] == [True, False, False]
    assert result.core.counters.adoptions == 2


def test_damaged_frames_are_counted_and_change_nothing(clean: Traffic, with_frames: Callable[..., Result]) -> None:
    good = safe_bed(7, enable=0)
    result = with_frames([(0, damaged(good, 40)), (1, good._replace(payload=good.payload[:-1]))], SAFE_ENABLE)
    assert result.frames == clean.result.frames
    assert (result.core.counters.crc_errors, result.core.counters.length_errors) == (1, 1)
    assert set(flags(with_frames([(0, good)], SAFE_ENABLE))) == {0}


def test_a_recording_does_not_switch_learning_off(tmp_path: Path) -> None:
    """Also where the signal is in the message of the samples, whose frames are made of the recording then."""
    path = slow_bench(tmp_path, {"learning_enable": ("SampleBlock", "FuelTemperature")})
    assert evaluate(load_bench(path), [simulated()]).evaluations[0].counters.adoptions > 0


def test_a_switch_that_stays_away_holds_nothing_up(tmp_path: Path, clean: Traffic) -> None:
    """Off before the first injection, and never heard of again: it counts for 80 ms."""
    path = slow_bench(tmp_path, ENABLE)
    path.write_text(path.read_text() + "timeout_ms = 80\n")
    result = run(path, inserted(clean.frames, [(0, bed("LearnEnable", 0))]))
    assert (flags(result)[0], flags(result)[-1]) == (0, 1)
    assert result.core.counters.adoptions == clean.result.core.counters.adoptions
    assert "a value counts for 0.08 s" in "".join(finding.text for finding in checkup(load_bench(path)))
