"""Disturbances of the realism bench: levels, spectra and places are what their names and sizes say."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.plants.plant import SIGNALS, Bench, Measured, Outcome, record
from tools.benchmarks.campaign import Task
from tools.benchmarks.realism.catalogue import (
    AND,
    DISTURBANCES,
    PAIRS,
    Selection,
    alone,
    entries,
    make_realism_case,
    name_of,
    pairs,
    parsed,
)
from tools.benchmarks.realism.channels import butterworth, butterworth_delay, energizing, filtered

OF_KIND = {"line": {"line_pressure"}, "rail": {"rail_pressure"}, "lift": {"needle_lift"}}
REALLY_HAPPENS = {"pump_ripple_620_hz", "pump_ripple_200_hz", "engine_transient"}

Values = NDArray[np.float64]


def bench_of(name: str, events: int = 6) -> Bench:
    """Without noise of the sensors."""
    bench = make_realism_case(Task(name, 1, 0)).bench
    around = replace(bench.around, starts=bench.around.starts[:events])
    return replace(bench, noise=0.0, events=bench.events[:events], around=around)


def both(name: str, events: int = 6) -> tuple[Outcome, Outcome]:
    """Disturbed, and what happened and was measured without what disturbs the signals."""
    bench = bench_of(name, events)
    around = replace(bench.around, before_noise=(), after_noise=())
    healthy = tuple(
        replace(e, faults=e.faults._replace(lift_sensor_lag=0.0, channel_skew=0.0)) for e in bench.events
    )
    return record(bench), record(replace(bench, around=around, events=healthy))


def added(name: str, signal: str, events: int = 6) -> Values:
    disturbed, plain = both(name, events)
    return np.asarray(getattr(disturbed.measured, signal) - getattr(plain.measured, signal), np.float64)


def amplitude(values: Values, frequency: float) -> float:
    time = np.arange(values.size) * 1e-5
    return float(2.0 * abs(np.mean(values * np.exp(-2j * math.pi * frequency * time))))


def whole_periods(values: Values, frequency: float) -> Values:
    period = 1e5 / frequency
    return values[: int(values.size // period * period)]


@pytest.mark.parametrize(
    ("name", "signal", "frequency", "size"),
    [
        ("hum_50_hz_line 0.2", "line_pressure", 50.0, 0.2e6),
        ("hum_150_hz_rail 0.3", "rail_pressure", 150.0, 0.3e6),
        ("hum_50_hz_lift 3", "needle_lift", 50.0, 3e-6),
    ],
)
def test_hum_is_one_line_of_its_spectrum(name: str, signal: str, frequency: float, size: float) -> None:
    hum = whole_periods(added(name, signal), frequency)
    assert amplitude(hum, frequency) == pytest.approx(size, rel=0.01)
    assert np.std(hum) == pytest.approx(size / math.sqrt(2.0), rel=0.01)


@pytest.mark.parametrize(("corner", "size"), [(300.0, 0.2), (3e3, 0.2), (10e3, 0.4)])
def test_coloured_noise_has_its_level_and_its_memory(corner: float, size: float) -> None:
    label = f"{corner / 1e3:g}_khz" if corner >= 1e3 else f"{corner:g}_hz"
    noise = added(f"coloured_{label}_line {size:g}", "line_pressure", events=12)
    assert np.std(noise) == pytest.approx(size * 1e6, rel=0.06)
    later = 5
    kept = np.mean(noise[later:] * noise[:-later]) / np.var(noise)
    assert kept == pytest.approx(math.exp(-2.0 * math.pi * corner * later * 1e-5), abs=0.03)


def test_power_of_pink_noise_falls_with_the_frequency() -> None:
    noise = added("pink_line 0.2", "line_pressure", events=12)
    power = np.abs(np.fft.rfft(noise)) ** 2
    frequency = np.fft.rfftfreq(noise.size, 1e-5)
    decades = [np.mean(power[(frequency > f) & (frequency < 10 * f)]) for f in (20.0, 200.0)]
    assert np.std(noise) == pytest.approx(0.2e6, rel=0.01)
    assert decades[0] / decades[1] == pytest.approx(10.0, rel=0.2)


def test_noise_three_times_larger_is_that_on_every_channel() -> None:
    bench = replace(bench_of("noise 3"), noise=1.0)
    measured = record(bench).measured
    rest = slice(0, 14_000)
    for signal, sigma in zip(SIGNALS, (0.1e6, 0.4e-6, 0.15e6), strict=True):
        assert np.std(getattr(measured, signal)[rest]) == pytest.approx(3.0 * sigma, rel=0.03)


def test_spikes_stand_at_the_edges_of_the_energizing_and_nowhere_else() -> None:
    bench = bench_of("spikes_at_edges 3", events=20)
    moments = np.concatenate(energizing(bench))
    for signal, height in zip(SIGNALS, (3e6, 20e-6, 3e6), strict=True):
        spikes = added("spikes_at_edges 3", signal, events=20)
        struck = np.flatnonzero(np.abs(spikes) > 0.5 * height)
        places = np.unique(np.searchsorted(np.sort(moments), struck * 1e-5, "right"))
        assert places.size == moments.size
        since = [float(np.min(np.where(moments <= t, t - moments, np.inf))) for t in struck * 1e-5 + 1e-9]
        assert max(since) < 4e-5
        np.testing.assert_allclose(np.abs(spikes[struck]), height, rtol=2e-3)


def test_a_spike_precedes_its_opening() -> None:
    bench = bench_of("spikes_at_edges 3")
    starts, ends = energizing(bench)
    openings = record(bench).openings[:, 0] * 1e-5
    assert np.all((openings - starts > 0.1e-3) & (openings - starts < 0.4e-3))
    assert np.all(ends > starts)


@pytest.mark.parametrize(
    ("name", "noisy_holds"), [("frozen_line 0.5", True), ("frozen_line_samples 0.5", False)]
)
def test_frozen_stretches_repeat_samples_only_where_noise_comes_before(name: str, noisy_holds: bool) -> None:
    bench = replace(bench_of(name, events=20), noise=1.0)
    line = record(bench).measured.line_pressure
    runs = np.diff(np.flatnonzero(np.concatenate(([True], np.diff(line) != 0.0, [True]))))
    longest = int(runs.max())
    assert (longest < 10) is noisy_holds
    if not noisy_holds:
        assert longest >= 50
        assert 20 < np.sum(runs >= 50) < 80  # 40 a second


@pytest.mark.parametrize("order", [2, 4])
def test_butterworth_has_its_corner_and_the_delay_that_is_stated(order: int) -> None:
    time = np.arange(20_000) * 1e-5
    corner, slow = 10e3, 100.0
    for frequency, height in ((slow, 1.0), (corner, math.sqrt(0.5))):
        wave = np.sin(2.0 * math.pi * frequency * time)
        seen = filtered(wave, 1e-5, butterworth(order, corner))[5_000:15_000]
        response = np.mean(seen * np.exp(-2j * math.pi * frequency * time[5_000:15_000])) * 2j
        assert abs(response) == pytest.approx(height, rel=0.01)
        if frequency == slow:
            late = -np.angle(response) / (2.0 * math.pi * slow)
            assert late == pytest.approx(butterworth_delay(order, corner), rel=0.01)


def later(samples: int, values: Values) -> Values:
    return np.concatenate([np.full(samples, values[0]), values[:-samples]])


@pytest.mark.parametrize(
    ("name", "signal", "law"),
    [
        ("lift_crosstalk 1.5", "needle_lift",
            lambda m: m.needle_lift + 1.5e-6 * (m.line_pressure - m.rail_pressure) / 10e6),
        ("late_line 20", "line_pressure", lambda m: later(2, m.line_pressure)),
        ("late_lift 10", "needle_lift", lambda m: later(1, m.needle_lift)),
        ("late_rail 20", "rail_pressure", lambda m: later(2, m.rail_pressure)),
        ("line_clipped_at_the_top 4", "line_pressure",
            lambda m: np.minimum(m.line_pressure, np.max(m.line_pressure) - 4e6)),
        ("line_clipped_at_the_bottom 4", "line_pressure",
            lambda m: np.maximum(m.line_pressure, np.min(m.line_pressure) + 4e6)),
    ],
)  # fmt: skip
def test_a_channel_shows_what_the_law_of_its_disturbance_says(
    name: str, signal: str, law: Callable[[Measured], Values]
) -> None:
    disturbed, plain = both(name)
    step = 0.02e-6 if signal == "needle_lift" else 0.01e6  # two codes of the bus
    np.testing.assert_allclose(getattr(disturbed.measured, signal), law(plain.measured), atol=step)


def test_a_lift_sensor_is_of_first_order_at_its_corner_and_has_so_many_codes() -> None:
    disturbed, plain = both("lift_filter 10")
    seen, true = disturbed.measured.needle_lift, plain.measured.needle_lift
    error = seen[1:-1] + (seen[2:] - seen[:-2]) / 2e-5 / (2.0 * math.pi * 10e3) - true[1:-1]
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean((seen - true) ** 2))
    codes = record(bench_of("few_bits 10")).measured.needle_lift / (500e-6 / 1024)
    np.testing.assert_allclose(codes, np.rint(codes), atol=0.02)


def test_ripple_and_transient_are_of_the_true_pressure() -> None:
    rippled = record(bench_of("pump_ripple_620_hz 1.5")).truth.rail_pressure
    assert amplitude(rippled - np.mean(rippled), 620.0) == pytest.approx(1.5e6, rel=0.05)
    moving = bench_of("engine_transient 20", events=20)
    steady = replace(moving, around=replace(moving.around, supply=()))
    gained = record(moving).truth.rail_pressure - record(steady).truth.rail_pressure
    assert np.max(gained) == pytest.approx(20e6)
    assert gained[-1] == pytest.approx(0.0, abs=1.0)
    rising = np.flatnonzero((gained > 1.0) & (gained < 20e6 - 1.0))
    assert rising.size == pytest.approx(2 * 2_000, abs=4)


@pytest.mark.parametrize("period", [30.0, 10.5, 8.0, 4.2])
def test_openings_come_every_few_milliseconds_up_to_the_end(period: float) -> None:
    bench = make_realism_case(Task(f"openings_every {period:g}", 1, 0)).bench
    outcome = record(replace(bench, noise=0.0))
    first = outcome.openings[:, 0] * 1e-5
    np.testing.assert_allclose(np.diff(first), period * 1e-3, atol=0.1e-3)
    assert outcome.event_of.tolist() == list(range(26))
    assert outcome.measured.time[-1] - first[-1] < period * 1e-3 + 0.011


def test_bounce_overshoot_and_slow_flanks_are_true_motion() -> None:
    def lifts(name: str) -> tuple[Values, Values]:
        bench = bench_of(name)
        plain = replace(bench, around=replace(bench.around, motion=None))
        return record(bench).truth.needle_lift, record(plain).truth.needle_lift

    bounced, plain = lifts("needle_bounce 30")
    assert np.max((bounced - plain)[plain == 0.0]) == pytest.approx(
        30e-6, rel=0.35
    )  # its corners are rounded
    over, plain = lifts("needle_overshoot 20")
    assert 10e-6 < over.max() - 300e-6 < 21e-6
    smooth, plain = lifts("smooth_needle_flanks 20")
    assert smooth.max() == pytest.approx(plain.max(), rel=0.01)
    low = [np.sum((lift > 3e-6) & (lift < 40e-6)) for lift in (smooth, plain)]
    assert low[0] > 2.0 * low[1]
    assert 10e-6 < record(bench_of("ballistic 0.2")).truth.needle_lift.max() < 200e-6  # never at its stop


@pytest.mark.parametrize("name", sorted(DISTURBANCES))
def test_every_disturbance_can_be_recorded_and_stays_on_its_channel(name: str) -> None:
    disturbance = DISTURBANCES[name]
    entry = f"{name} {disturbance.sizes[-1]:g}"
    disturbed, plain = both(entry, events=12)
    changed = {s for s in SIGNALS if np.any(getattr(disturbed.measured, s) != getattr(plain.measured, s))}
    if disturbance.kind in OF_KIND and name not in REALLY_HAPPENS:
        assert changed == OF_KIND[disturbance.kind]
    assert (name != "none") or not changed
    for signal, values in vars(plain.truth).items():  # the injector takes no notice
        np.testing.assert_array_equal(getattr(disturbed.truth, signal), values)


def test_the_same_recording_comes_again() -> None:
    bench = make_realism_case(Task("frozen_line 0.2 + noise 2", 1, 0)).bench
    np.testing.assert_array_equal(record(bench).measured.line_pressure, record(bench).measured.line_pressure)


def test_names_lead_back_to_their_entries() -> None:
    for entry in alone() + pairs(1):
        assert parsed(name_of(entry)) == entry


def test_pairs_are_drawn_by_the_seed() -> None:
    drawn = [name_of(pair) for pair in pairs(1)]
    assert len(set(drawn)) == PAIRS
    assert drawn == [name_of(pair) for pair in pairs(1)]
    assert drawn != [name_of(pair) for pair in pairs(2)]
    assert all(AND in name for name in drawn)


def test_only_some_are_run() -> None:
    names: Callable[..., set[str]] = lambda *only: {name_of(e) for e in entries(Selection.ALL, only, 1)}  # noqa: E731
    assert {"noise 2", "noise 3", "noise 5"} <= names("noise")
    assert all("noise " in name for name in names("noise"))
    assert names("frozen_line 0.2") == {"frozen_line 0.2"}


def test_what_the_bench_file_states_changes_nothing_of_the_recording() -> None:
    plain, stated = (record(bench_of(name)).measured for name in ("lift_filter 5", "lift_filter 5 stated"))
    np.testing.assert_array_equal(plain.needle_lift, stated.needle_lift)
    np.testing.assert_array_equal(plain.line_pressure, stated.line_pressure)
