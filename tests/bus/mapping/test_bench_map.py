"""Maps of several injectors: a message of both stands once, and what they must not share is named."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bench_map import map_bench, shared_resources
from observer_rt.config.bench import load_bench
from tests.daemon.pulses import EnergizingBy as By
from tests.daemon.pulses import pulse_bench
from tests.two_injectors import two_injectors


def test_a_message_that_both_read_stands_once_and_what_they_must_not_share_is_named(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    mapped = map_bench(bench)
    assert [{(layout.name, layout.bus) for layout in bus.input_layouts} for bus in mapped.injectors] == [
        {("RailPressureBlock", 0), ("NeedleLiftBlock", bus), ("LinePressureBlock", bus)} for bus in (1, 2)
    ]
    assert [(layout.name, layout.bus) for layout in mapped.sent] == [
        (name, bus) for bus in (1, 2) for name in ("InjectionRate", "InjectionSummary", "ObserverStatus")
    ]
    received = [(layout.name, layout.bus) for layout in mapped.received]
    assert len(received) == len({*received}) == 5  # one rail pressure, two lifts and line pressures
    assert [*shared_resources(bench, mapped)] == []
    path = tmp_path / "two.toml"
    text = path.read_text().replace("injector_id = 2", "injector_id = 1").replace('\nlink = "right"\ninj', "\ninj")
    path.write_text(text)
    bench = load_bench(path)
    shared = dict(shared_resources(bench, map_bench(bench)))
    assert shared == {"outputs.injector_id = 1": ["left", "right"]}


@pytest.mark.parametrize(
    ("lines", "index"), [(By.TIME, "PulseIndex"), (By.TIME_BY_STAMP, None), (By.LEVELS_IN_BLOCK, "SampleIndex")]
)
def test_commands_have_the_index_that_is_stated_or_usual(tmp_path: Path, lines: str, index: str | None) -> None:
    (injector,) = map_bench(load_bench(pulse_bench(tmp_path, lines))).injectors
    assert injector.energizing is not None
    assert injector.energizing.index == index
