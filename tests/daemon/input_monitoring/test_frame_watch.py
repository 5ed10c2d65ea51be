"""Damaged frames, two devices with one identifier, outages and another sample rate are reported with a remedy."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.bus.alignment import Jitter, MessageTiming
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.daemon.input_monitoring.arrivals import Arrivals
from observer_rt.daemon.input_monitoring.frame_watch import LASTING, LOOKS, FrameWatch, RateWatch
from observer_rt.daemon.input_monitoring.input_watch import IN_A_ROW, SWAPPED, UnitWatch
from observer_rt.daemon.input_monitoring.input_watch import LOOKS as UNIT_LOOKS
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.stream.state import Reason

RATE = 100e3
SOURCES = Arrivals(map_bus(load_bench())).sources
SAMPLE_BLOCK = "SampleBlock 0x100 (rail_pressure, needle_lift, line_pressure)"


@pytest.fixture
def arrivals() -> Arrivals:
    return Arrivals(map_bus(load_bench()))


@pytest.fixture
def counters() -> Counters:
    bench = load_bench()
    return Core(bench.injector, map_bus(bench), learning=False).counters


def messages_of_looks(
    arrivals: Arrivals,
    watch: FrameWatch,
    counters: Counters,
    step: dict[str, int],
    looks: int,
    is_explained: bool = False,
) -> list[str]:
    """Texts reported in so many looks; before each, counters and frames of every message rise by `step`."""
    texts = []
    for _ in range(looks):
        for source in arrivals.sources:
            frames = arrivals.count_of(source).frames
            arrivals.set(source.layout, frames + step.get("frames", 0), 0)
        vars(counters).update({name: getattr(counters, name) + more for name, more in step.items()})
        texts += [notice.text for notice in watch.look(replace(counters), is_explained)]
    return texts


@pytest.mark.parametrize(
    ("counter", "said"),
    [
        (
            "crc_errors",
            "5 % of frames have a wrong CRC\n  remedy: the bus is disturbed: check cable, termination",
        ),
        ("length_errors", "5 % of frames have another length than the database says"),
        (
            "repeated_frames",
            "5 % of frames come twice, the first of them counts\n  remedy: do two devices send one",
        ),
        ("old_frames", "5 % of frames come too late"),
        (
            "sequence_errors",
            "15 % of frames have an alive counter that does not count on\n  remedy: is it stuck",
        ),
    ],
)
def test_useless_frames_are_reported_once_with_their_share_and_when_they_end(
    arrivals: Arrivals, counters: Counters, counter: str, said: str
) -> None:
    watch = FrameWatch(arrivals, RATE)
    assert messages_of_looks(arrivals, watch, counters, {"frames": 1000, counter: 1}, 2 * LOOKS + 1) == []
    (message,) = messages_of_looks(
        arrivals, watch, counters, {"frames": 1000, counter: 10 * int(said.split()[0])}, 4 * LOOKS
    )
    assert message.startswith(f"{SAMPLE_BLOCK}: ")
    assert said in message
    (over,) = messages_of_looks(arrivals, watch, counters, {"frames": 1000}, 3 * LOOKS)
    assert "no more frames that" in over


def test_frames_whose_fault_another_watch_reported_are_not_reported_again(
    arrivals: Arrivals, counters: Counters
) -> None:
    watch = FrameWatch(arrivals, RATE)
    assert (
        messages_of_looks(
            arrivals, watch, counters, {"frames": 1000, "crc_errors": 900}, 4 * LOOKS, is_explained=True
        )
        == []
    )


def test_an_outage_is_reported_with_its_length(arrivals: Arrivals, counters: Counters) -> None:
    watch = FrameWatch(arrivals, RATE)
    assert messages_of_looks(arrivals, watch, counters, {"frames": 1000, "lost_samples": 90}, 5) == []
    (message,) = messages_of_looks(arrivals, watch, counters, {"lost_samples": 20_000}, 1)
    assert f"{SAMPLE_BLOCK}: 20000 samples were lost at once, 0.2 s\n  remedy: check cable" in message


def timing(drift: float) -> list[MessageTiming]:
    return [MessageTiming("SampleBlock", Jitter(10_000, 1e-6, 1e-5), drift, 0.0, 0.0)]


def test_the_rate_that_the_bench_file_should_state_is_named() -> None:
    """The bench file says 50 kHz and samples come at 100 kHz: each takes half the stated time, a drift of -0.5."""
    watch = RateWatch(50e3)
    assert not [*watch.look(timing(-0.5003), Reason.NONE)] * LASTING  # a replay at another speed
    looks = [watch.look(timing(-0.5003), Reason.MODEL_INADEQUATE) for _ in range(3 * LASTING)]
    (message,) = (notice.text for notices in looks for notice in notices)
    assert "samples come at 100060 a second, sampling.rate_hz is 50000" in message
    assert "sampling.rate_hz is likely 100000;" in message
    assert watch.reported == message
    assert not [*watch.look(timing(1e-5), Reason.MODEL_INADEQUATE)]
    assert not watch.reported


def test_the_report_at_the_stop_does_not_say_that_another_rate_has_no_effect() -> None:
    assert "no effect" in timing(1e-5)[0].as_text()
    said = timing(-0.5)[0].as_text()
    assert "sent at 2 times its rate" in said
    assert "no effect" not in said
    assert "sampling.rate_hz" in said


def test_swapped_pressures_are_named_live() -> None:
    watch = UnitWatch(SOURCES)
    time = np.linspace(0.0, 1.0, 200)
    rail, line = 100e6 + 1e3 * np.arange(200) % 3, 100e6 - 15e6 * np.sin(40.0 * time)
    lift = 0.3e-3 * (time > 0.5)

    def looks(rail: np.ndarray, line: np.ndarray, lift: np.ndarray) -> list[str]:
        samples = {Role.RAIL_PRESSURE: rail, Role.LINE_PRESSURE: line, Role.NEEDLE_LIFT: lift}
        newest = np.array([samples[role][-1] for role in Role])
        return [notice.text for _ in range(UNIT_LOOKS * IN_A_ROW) for notice in watch.look(newest, samples)]

    assert looks(rail, line, lift) == []
    (message,) = looks(line, rail, lift)
    assert "most likely the two are swapped" in message
    assert "remedy: compare their columns or signals" in message
    assert [*watch.reported] == [SWAPPED]
    assert looks(line, rail, 0.0 * lift) == []  # a needle that stays shut tells nothing
    (over,) = looks(rail, line, lift)
    assert "in its range again" in over
