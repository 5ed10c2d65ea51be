"""Another sample rate, pressures that are swapped and a lift that never shuts are named live."""

import numpy as np

from observer_rt.bus.alignment import Jitter, MessageTiming
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.daemon.arrivals import Arrivals
from observer_rt.daemon.signal_watch import LASTING, SURVEYED, SURVEYS, SWAPPED, RateWatch, UnitWatch
from observer_rt.engine.stream.state import Reason


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


def test_the_report_at_the_stop_names_another_rate() -> None:
    assert timing(1e-5)[0].as_text().endswith("drift +10.0 ppm; samples are counted")
    assert "sent at 2 times sampling.rate_hz" in timing(-0.5)[0].as_text()


def test_swapped_pressures_and_a_needle_that_never_shuts_are_named_live() -> None:
    watch = UnitWatch(Arrivals(map_bus(load_bench())).sources)
    time = np.linspace(0.0, 1.0, 200)
    rail, line = 100e6 + 1e3 * np.arange(200) % 3, 100e6 - 15e6 * np.sin(40.0 * time)
    lift = 0.3e-3 * (time > 0.5)

    def looks(rail: np.ndarray, line: np.ndarray, lift: np.ndarray) -> list[str]:
        samples = {Role.RAIL_PRESSURE: rail, Role.LINE_PRESSURE: line, Role.NEEDLE_LIFT: lift}
        newest = np.array([samples[role][-1] for role in Role])
        return [notice.text for _ in range(SURVEYED * SURVEYS) for notice in watch.look(newest, samples)]

    assert looks(rail, line, lift) == []
    (message,) = looks(line, rail, lift)
    assert "most likely the two are swapped" in message
    assert "remedy: compare their columns or signals" in message
    assert [*watch.reported] == [SWAPPED]
    assert looks(line, rail, 0.0 * lift) == []  # a needle that stays shut tells nothing
    (over,) = looks(rail, line, lift)
    assert "is well again" in over
    assert looks(rail, line, lift + 30e-6) == []  # a zero that the observer follows
    (message,) = looks(rail, line, lift + 50e-6)  # by a database of another scale
    assert "needle_lift is never below 50 um, as if the needle never shut\n  remedy: check its zero" in message
