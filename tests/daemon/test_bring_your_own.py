"""Databases as benches have them, with the bench files of `docs/dbc.md`: the same samples, the same estimate."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path

import cantools.database
import e2e.p01
import numpy as np
import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.output_signals import StatusValues
from observer_rt.config.bench import PACKAGE_DATA, load_bench, load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.parameters import NOZZLE
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.recording_frames import recording_frames
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.model.effects import sized
from tests.benches import sample_bench
from tests.daemon.foreign_frames import DATABASES, INJECTIONS, classic_frames, database, fd_frames, multiplexed_frames
from tests.daemon.participants import HeardDaemon, ScriptedLink, serving, until
from tests.device import Device, Result, frames_of, run, simulated

Frames = Callable[[Recording], Iterable[TimedFrame]]


def rates_of(result: Result) -> dict[int, float]:
    rows = result.core.rows(0, result.core.processed)
    return dict(zip(rows["index"].tolist(), rows["injection_rate"].tolist(), strict=True))


def in_blocks(folder: Path, rate: float, data: Recording) -> Result:
    path = sample_bench(folder / "blocks", rate=rate)
    return run(path, Device(path).send(data))


@pytest.fixture(scope="module")
def in_our_layout(tmp_path_factory: pytest.TempPathFactory) -> Callable[[float], Result]:
    return cache(lambda rate: in_blocks(tmp_path_factory.mktemp("own"), rate, simulated(rate=rate)))


EXAMPLES = [
    ("testbed_classic", 10e3, classic_frames),
    ("fast_daq_fd", 50e3, fd_frames),
    ("adc_multiplexed", 50e3, multiplexed_frames),
]


@pytest.mark.parametrize(("name", "rate", "frames"), EXAMPLES)
def test_the_same_estimate_as_in_our_own_layout(
    name: str, rate: float, frames: Frames, in_our_layout: Callable[[float], Result]
) -> None:
    own = in_our_layout(rate)
    foreign = run(DATABASES / f"{name}.toml", frames(simulated(rate=rate)))
    assert foreign.core.counters.lost_samples == 0
    assert foreign.core.counters.repeated_frames == foreign.core.counters.old_frames == 0
    assert len(foreign.reports) == len(own.reports) == INJECTIONS
    for ours, theirs in zip(own.reports, foreign.reports, strict=True):
        assert (theirs.start_index, theirs.end_index) == (ours.start_index, ours.end_index)
        assert theirs.valid == ours.valid
        assert theirs.mass == pytest.approx(ours.mass, rel=1e-3)
    both = rates_of(foreign), rates_of(own)
    common = sorted(set(both[0]) & set(both[1]))
    assert len(common) > 1000
    estimated, expected = (np.array([rates[n] for n in common]) for rates in both)
    assert np.array_equal(np.isnan(estimated), np.isnan(expected))
    assert np.nanmax(expected) > 30e-6  # there was something to compare
    assert np.sqrt(np.nanmean((estimated - expected) ** 2)) < 0.05e-6


@pytest.mark.parametrize(("name", "rate", "frames"), EXAMPLES)
def test_replay_sends_what_cantools_encodes(name: str, rate: float, frames: Frames) -> None:
    """By frame: what a replay of the same recording by the bench file puts on the bus."""
    data = simulated(rate=rate)
    db = database(name)

    def contents(sent: Iterable[TimedFrame]) -> dict[int, list[dict[str, float]]]:
        values_by_message: dict[int, list[dict[str, float]]] = {}
        for frame in sent:
            message = db.get_message_by_frame_id(frame.frame_id)
            raw = message.decode(frame.payload, decode_choices=False, scaling=False)
            kept = {n: v for n, v in raw.items() if not n.endswith(("SensorState", "Temperature", "Page"))}
            if kept.get("ADC_Channel") != 15:
                values_by_message.setdefault(frame.frame_id, []).append(kept)
        return values_by_message

    bench = load_bench(DATABASES / f"{name}.toml")
    replayed = contents(frames_of(bench, data))
    sent_in_parts = list(recording_frames(HeldSignals(data), map_bus(bench), windowed=False))
    assert len(sent_in_parts) == sum(map(len, replayed.values()))
    expected = contents(frames(data))
    assert expected.keys() == replayed.keys()
    for frame_id, sent in expected.items():
        assert replayed[frame_id][: len(sent)] == sent
        assert len(replayed[frame_id]) - len(sent) <= 6  # the last block, which is not full


def test_a_lost_half_of_a_channel_is_lost_samples() -> None:
    sent = list(multiplexed_frames(simulated(rate=50e3)))[:3000]
    fourth = [n for n, frame in enumerate(sent) if frame.payload[0] & 0xF == 3][100]
    outcome = run(DATABASES / "adc_multiplexed.toml", sent[:fourth] + sent[fourth + 1 :])
    assert (outcome.core.counters.lost_samples, outcome.core.counters.jumps) == (3, 0)


def _pages(frames: Sequence[OutputFrame] | Sequence[Frame], name: str) -> list[dict[str, float]]:
    message = cantools.database.load_file(PACKAGE_DATA / "observer_classic.dbc").get_message_by_name(name)
    pages = [frame for frame in frames if frame.frame_id == message.frame_id]
    whole_messages: list[dict[str, float]] = []
    for number, frame in enumerate(pages):
        assert len(frame.payload) == 8
        assert e2e.p01.e2e_p01_check(bytearray(frame.payload), message.frame_id, length=8)
        values = message.decode(frame.payload, decode_choices=False)
        assert values["Counter"] == number % 15
        if values["Page"] == 0:
            whole_messages.append({})
        whole_messages[-1] |= values
    return whole_messages


def test_a_classic_bus_gets_summaries_and_no_rates() -> None:
    outcome = run(DATABASES / "testbed_classic.toml", classic_frames(simulated(rate=10e3)))
    assert {frame.frame_id for frame in outcome.frames} == {0x201}
    summaries = _pages(outcome.frames, "InjectionSummary")
    assert len(summaries) == len(outcome.reports) == INJECTIONS
    for summary, report in zip(summaries, outcome.reports, strict=True):
        assert (summary["SampleIndex"], summary["EndIndex"]) == (report.start_index, report.end_index)
        assert (summary["InjectionNumber"], summary["Valid"]) == (report.number, report.valid)
        assert summary["Reason"] == report.reason
        assert summary["Mass"] == pytest.approx(report.mass / 1e-6, abs=0.005)
        assert summary["NozzleWear"] == pytest.approx(report.indicators[NOZZLE].value, abs=5e-5)
        assert summary["RailPressureAtStart"] == pytest.approx(report.rail_pressure / 1e6, abs=0.0025)


def test_a_daemon_sends_summaries_and_status_in_pages(tmp_path: Path) -> None:
    text = (DATABASES / "testbed_classic.toml").read_text()
    text = text.replace('"testbed_classic.dbc"', f'"{DATABASES / "testbed_classic.dbc"}"')
    path = tmp_path / "bench.toml"
    path.write_text(text + "status_period_ms = 1000\n[learning]\nlockstep = true\n")
    data = simulated(rate=10e3)
    link = ScriptedLink(frames_of(load_bench(path), data))
    daemon = HeardDaemon(path, link)
    with serving(daemon):
        until(lambda: daemon.core.counters.frames >= link.frames)
    assert not any(frame.is_fd for frame in link.sent)
    assert {frame.frame_id for frame in link.sent} == {0x201, 0x202}
    direct = run(DATABASES / "testbed_classic.toml", classic_frames(data))
    assert [f.payload for f in link.sent if f.frame_id == 0x201] == [f.payload for f in direct.frames]
    status = _pages(link.sent, "ObserverStatus")[-1]
    assert (status["SamplesProcessed"], status["LostSamples"]) == (daemon.core.processed, 0)
    # CRC, counter and page too, but nothing of the energizing, of outliers, of refused frames and unlearned events
    assert len(status) == len(StatusValues._fields) + 3 - 6


def classic_layout(folder: Path, rate: float) -> Path:
    roles = {"rail_pressure": "RailPressure", "needle_lift": "NeedleLift", "line_pressure": "LinePressure"}
    text = '[link]\nfd = false\ninterface = "virtual"\n[[dbc]]\nfile = "observer_classic.dbc"\n'
    text += "".join(f'[signals.{role}]\nmessage = "Sample"\nsignal = "{name}"\n' for role, name in roles.items())
    path = folder / "bench.toml"
    path.write_text(text + f"[sampling]\nrate_hz = {rate}\n[outputs]\ninjection_rate = false\n")
    return path


def test_our_classic_layout(tmp_path: Path) -> None:
    """Nothing is valid until the clock by counter and time is trusted; then estimates are our FD layout's to 1 %."""
    schedule = make_schedule([100e6], 10, 0.2, [1.1e-3])
    effects = (sized("orifice_area", v_H=0.2),)
    data = simulate(load_injector(), schedule, 10e3, effects, SimulatedNoise(), seed=8).recording
    frames = frames_of(classic_layout(tmp_path, 10e3), data)
    for number, frame in enumerate(frames):
        assert e2e.p01.e2e_p01_check(bytearray(frame.payload), 256, length=8)
        assert frame.payload[1] == number % 15
    classic = run(tmp_path / "bench.toml", frames)
    own = in_blocks(tmp_path, 10e3, data)
    assert classic.core.counters.lost_samples == 0
    assert len(_pages(classic.frames, "InjectionSummary")) == len(classic.reports) == len(own.reports) == 10
    assert not any(report.valid for report in classic.reports[:4])
    for report, expected in zip(classic.reports[6:], own.reports[6:], strict=True):
        assert report.valid
        assert report.mass == pytest.approx(expected.mass, rel=0.01)
