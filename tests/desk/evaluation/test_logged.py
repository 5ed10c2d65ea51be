"""CAN logs through the observer: the frames of a log give what the recording gives, bit for bit."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import Bench, load_bench
from observer_rt.desk.evaluation.evaluate import History, evaluate
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.replay.framing import Span, all_samples, windows_of
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from tests.benches import bench_with, block_bench, own_bench
from tests.daemon.time_frames import Clock, merged, plant, send, write_time_bench
from tests.daemon.time_scenarios import LIFT_ALONE
from tests.device import frames_of, simulated, worn_recording
from tests.files.canlog.log_cases import sent_log, write_log

BENCH = load_bench().exact
RATE = 100e3
START = 1_700_000_000_123_456_000  # ns since 1970


def worn() -> Recording:
    return simulated(3, 0.3, (60e6, 120e6), RATE, seed=3)


@cache
def frames(bench: Bench = BENCH) -> list[LogFrame]:
    return log_of(worn(), all_samples(worn()), bench)


def log_of(recording: Recording, spans: list[Span], bench: Bench = BENCH) -> list[LogFrame]:
    return sent_log(frames_of(bench, recording, spans), START)


@cache
def expected() -> History:
    return evaluate(BENCH, [worn()])


@pytest.fixture
def write(tmp_path: Path) -> Callable[[list[LogFrame], str], Path]:
    return lambda frames, suffix: write_log(tmp_path / f"bus{suffix}", frames)


@pytest.fixture
def classic_bench(tmp_path: Path) -> Bench:
    """Two samples in a frame of 8 bytes, one message a signal, 20 kHz."""
    lines, signals = ['VERSION ""', "BU_: Daq"], {}
    for number, (role, code) in enumerate(
        (
            ("rail_pressure", '(0.005,-10) [0|0] "MPa"'),
            ("needle_lift", '(0.01,-50) [0|0] "um"'),
            ("line_pressure", '(0.005,-10) [0|0] "MPa"'),
        )
    ):
        lines += [f"BO_ {0x300 + number} {role}_frame: 8 Daq", ' SG_ Index : 0|32@1+ (1,0) [0|0] "" Daq']
        lines += [f" SG_ {role}_{k} : {32 + 16 * k}|16@1+ {code} Daq" for k in range(2)]
        signals[role] = f'message = "{role}_frame"\nindex = "Index"\npattern = "{role}_{{}}"'
    rate = "[sampling]\nrate_hz = 20e3\n"
    return load_bench(own_bench(tmp_path, "\n".join([*lines, ""]), signals, rate))


Write = Callable[[list[LogFrame], str], Path]


def test_the_frames_of_a_log_give_what_the_recording_gives(write: Write) -> None:
    logged = LoggedSignals(BENCH, write(frames(), ".blf"))
    assert logged.notes == ()
    history = evaluate(BENCH, [logged])
    assert (history.frames, len(history.evaluations[0].reports)) == (expected().frames, 3)
    all_samples = expected().evaluations[0].trace
    for name in ("injection_rate", "corrected_rate_sigma", "nominal_rate", "valid", "state", "x", "phi"):
        np.testing.assert_array_equal(history.evaluations[0].trace[name][: len(all_samples)], all_samples[name])


def test_classic_frames_give_what_the_recording_gives(write: Write, classic_bench: Bench) -> None:
    recording = simulated(2, 0.0, (60e6,), 20e3, seed=4)
    path = write(log_of(recording, all_samples(recording), classic_bench), ".mf4")
    logged = LoggedSignals(classic_bench, path)
    assert logged.notes == ()
    reference = evaluate(classic_bench, [recording])
    assert len(reference.evaluations[0].reports) == 2
    assert evaluate(classic_bench, [logged]).frames == reference.frames


@pytest.mark.parametrize(
    ("role", "most", "said"),
    [
        ("rail_pressure", 90, "; the other pressure goes as far, so that range is wrong"),
        ("line_pressure", 124, ""),  # beyond it only rings
    ],
)
def test_values_outside_the_declared_range_are_counted_and_taken_leniently(
    write: Write, classic_bench: Bench, role: str, most: int, said: str
) -> None:
    recording = simulated(2, 0.0, (60e6, 120e6), 20e3, seed=4)
    path = write(log_of(recording, all_samples(recording), classic_bench), ".blf")
    database, bench = (classic_bench.path.with_name(name) for name in ("user.dbc", "bench.toml"))
    code = f"16@1+ (0.005,-10) [0|{most}]"
    database.write_text(
        re.sub(rf"({role}_\d : \d+\|)16@1\+ \(0.005,-10\) \[0\|0\]", rf"\g<1>{code}", database.read_text())
    )
    logged = LoggedSignals(load_bench(bench), path)
    signal = getattr(recording, role)
    beyond = int(np.count_nonzero(signal > 1.01 * most * 1e6))
    assert 0 < beyond == np.count_nonzero(np.isnan(getattr(logged.collected(), role)[: recording.samples]))
    (note,) = logged.notes
    assert f"{role}: {beyond} values outside [0|{most}] of {role}_{{}} in {role}_frame taken as missing" in note
    reached = re.search(r"to ([\d.]+)", note)
    assert reached is not None
    assert float(reached[1]) == pytest.approx(signal.max() / 1e6, abs=0.006)
    assert f"{said}\n  remedy: correct the range" in note
    bench.write_text(bench.read_text().replace('"user.dbc"', '"user.dbc"\nlenient = true'))
    lenient = LoggedSignals(load_bench(bench), path)
    assert lenient.notes == ()
    np.testing.assert_allclose(getattr(lenient.collected(), role)[: recording.samples], signal, atol=2.6e3)


def test_a_range_without_any_value_sent_is_the_cause(write: Write, classic_bench: Bench) -> None:
    recording = simulated(1, 0.0, (60e6,), 20e3, seed=4)
    path = write(log_of(recording, all_samples(recording), classic_bench), ".blf")
    database = classic_bench.path.with_name("user.dbc")
    database.write_text(database.read_text().replace("(0.005,-10) [0|0]", "(0.005,-10) [0|20]"))
    with pytest.raises(UserError, match=r"rail_pressure: \d+ values outside \[0\|20\]") as refused:
        LoggedSignals(load_bench(classic_bench.path), path)
    assert "a second" not in refused.value.problem
    assert "lenient = true" in refused.value.remedy


def test_delays_stay_in_what_was_sent(write: Write) -> None:
    """Whoever reads the samples undoes them, once."""
    path = write(frames(), ".blf")
    late = bench_with(
        rail_pressure={"filter_delay_us": 30.0},
        needle_lift={"filter_delay_us": 23.0, "lag_us": 16.0},
        line_pressure={"filter_delay_us": 7.0},
    )
    result, sent = (LoggedSignals(bench, path).collected() for bench in (late, BENCH))
    for name in ("time", "rail_pressure", "needle_lift", "line_pressure"):
        np.testing.assert_array_equal(getattr(result, name), getattr(sent, name))
    assert evaluate(late, [LoggedSignals(late, path)]).frames == evaluate(late, [worn()]).frames


def test_samples_that_were_lost_are_not_available(write: Write) -> None:
    kept = frames()[:100] + frames()[103:]
    result = LoggedSignals(BENCH, write(kept, ".log")).collected()
    assert np.flatnonzero(np.isnan(result.rail_pressure[: 9 * 1000])).tolist() == list(range(900, 927))


def test_windows_of_a_source_keep_their_place(write: Write) -> None:
    spans = windows_of([worn()])
    logged = LoggedSignals(BENCH, write(log_of(worn(), spans), ".log"))
    assert logged.logged[0].start == spans[0].start
    sent = ~np.isnan(logged.collected().line_pressure)
    expected_samples = np.concatenate([np.arange(span.start, span.end) for span in spans])
    assert set(expected_samples - spans[0].start) <= set(np.flatnonzero(sent))
    (evaluation,) = evaluate(BENCH, [logged]).evaluations
    assert [report.start_index for report in evaluation.reports] == pytest.approx(
        [report.start_index for report in expected().evaluations[0].reports], abs=2
    )


def test_inputs_on_several_channels_need_a_choice(write: Write) -> None:
    doubled = [frame._replace(channel=channel) for frame in frames() for channel in "12"]
    path = write(doubled, ".blf")
    with pytest.raises(UserError, match="SampleBlock is on several channels: 1, 2"):
        LoggedSignals(BENCH, path)
    assert evaluate(BENCH, [LoggedSignals(BENCH, path, ("2",))]).frames == expected().frames
    with pytest.raises(UserError, match="no channel 7"):
        LoggedSignals(BENCH, path, ("7",))


def test_lift_of_another_clock_is_brought_to_the_samples_of_the_line_pressure(tmp_path: Path) -> None:
    """It moves by 1.2 um/us at most: 20 us late it would be wrong by up to 24 um."""
    bench = load_bench(write_time_bench(tmp_path, 20e3, LIFT_ALONE))
    sent = merged(send("RailLine", Clock(20e3), end=1.2), send("Lift", Clock(20e3, 20e-6), end=1.2))
    path = tmp_path / "two_clocks.log"
    write_log(path, [LogFrame(Frame(f.frame_id, f.payload, f.stamp_ns), "1") for f in sent])
    logged = LoggedSignals(bench, path)
    truth = plant()[1]
    result = logged.collected()
    lift = np.interp(result.time + logged.logged[0].start / 20e3, truth.time, truth.needle_lift)
    moving = (lift > 50e-6) & (lift < 250e-6) & ~np.isnan(result.needle_lift)
    assert moving.sum() > 20
    assert np.abs(result.needle_lift - lift)[moving].max() < 8e-6


def test_a_message_that_is_not_in_the_log_is_named(tmp_path: Path) -> None:
    """Not the bench file is blamed: the frames of the other messages are good."""
    bench = block_bench(tmp_path, "virtual", ["x"])
    sent = frames_of(bench, worn_recording())
    write_log(tmp_path / "a.log", sent_log(frame for frame in sent if frame.frame_id != 0x111))
    with pytest.raises(UserError) as refused:
        LoggedSignals(load_bench(bench), tmp_path / "a.log")
    assert "NeedleLiftBlock 0x111 (needle_lift): no frame in the log" in refused.value.problem
    assert "--bench" not in (refused.value.remedy or "")


def test_a_clock_an_hour_ahead_is_named_where_an_index_joins_the_samples(tmp_path: Path) -> None:
    """No message is said to be silent."""
    bench = load_bench(block_bench(tmp_path, "virtual", ["x"]))
    sent = sent_log(frames_of(bench, worn_recording()))
    moved = [
        each._replace(frame=each.frame._replace(stamp_ns=each.frame.stamp_ns + 3600 * 10**9), channel="2")
        if each.frame.frame_id == 0x111
        else each
        for each in sent
    ]
    (note,) = LoggedSignals(bench, write_log(tmp_path / "a.log", moved)).notes
    assert "NeedleLiftBlock begins 3600 s after RailPressureBlock" in note


@pytest.mark.parametrize(
    ("injections", "end", "is_dead", "said"),
    [
        (24, 0.5, False, "(needle_lift): no frame in the last 0.9 s"),
        (12, np.inf, True, "(needle_lift): needle_lift is frozen"),
    ],
)
def test_an_unfit_message_is_named(tmp_path: Path, injections: int, end: float, is_dead: bool, said: str) -> None:
    bench, recording = block_bench(tmp_path, "virtual", ["x"]), worn_recording(injections=injections)
    sent = replace(recording, needle_lift=recording.needle_lift * (not is_dead))
    frames = [each for each in frames_of(bench, sent) if each.frame_id != 0x111 or each.time < end]
    write_log(tmp_path / "a.log", sent_log(frames))
    notes = LoggedSignals(load_bench(bench), tmp_path / "a.log").notes
    assert any(f"NeedleLiftBlock 0x111 {said}" in note for note in notes)
