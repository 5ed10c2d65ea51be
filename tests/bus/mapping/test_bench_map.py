"""The buses of several injectors: each has its map, a message may be of several."""

from pathlib import Path

from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import load_bench
from tests.two_injectors import one_injector, two_injectors


def test_a_frame_goes_to_every_injector_that_reads_it(tmp_path: Path) -> None:
    bench = load_bench(two_injectors(tmp_path))
    mapped = map_bench(bench)
    carried = [{(layout.name, layout.bus) for layout in bus.input_layouts} for bus in mapped.injectors]
    assert carried == [
        {("RailPressureBlock", 0), ("NeedleLiftBlock", bus), ("LinePressureBlock", bus)} for bus in (1, 2)
    ]
    assert [layout.name for layout in mapped.received].count("RailPressureBlock") == 1
    assert [(layout.name, layout.bus) for layout in mapped.sent] == [
        (name, bus) for bus in (1, 2) for name in ("InjectionRate", "InjectionSummary", "ObserverStatus")
    ]


def test_an_injector_has_the_map_it_has_alone(tmp_path: Path) -> None:
    for number, bus in enumerate(map_bench(load_bench(two_injectors(tmp_path))).injectors, 1):
        alone = map_bus(load_bench(one_injector(tmp_path, ("left", "right")[number - 1], number)))
        assert bus.input_layouts == alone.input_layouts
        assert [table.tobytes() for table in (bus.inputs.messages, bus.inputs.groups, bus.inputs.timing)] == [
            table.tobytes() for table in (alone.inputs.messages, alone.inputs.groups, alone.inputs.timing)
        ]
