"""The view of several injectors: a line for each, and one of them as a whole."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import load_bench
from observer_rt.service.daemon import Daemon
from observer_rt.service.screen.view import TURN, Overview, View
from tests.device import worn_recording
from tests.service.participants import ScriptedLink, drawn, serving, until
from tests.three_injectors import NAMES, frames_of_all, one_alone, three_injectors


@pytest.fixture
def overview(tmp_path: Path) -> Overview:
    """The first has seen four injections, the second waits for data, the third for its interface."""
    bench = load_bench(three_injectors(tmp_path, "overview"))
    mapped = map_bench(bench)
    views = [View(f"{each.injector.name}: title", each.injector) for each in bench.each]
    links = [ScriptedLink(frames_of_all([one_alone(tmp_path, 0, "x")], [worn_recording()])), ScriptedLink()]
    for alone, bus, link, view in zip(bench.each, mapped.injectors, links, views, strict=False):
        daemon = Daemon(alone, bus, [link], listeners=[view.hear])
        view.watch(daemon)
        with serving(daemon):
            until(link.empty.is_set)
    return Overview(views)


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40)])
def test_all_of_them_and_one_as_a_whole(overview: Overview, width: int, height: int) -> None:
    for turn, name in enumerate((*NAMES, NAMES[0])):
        lines = [line.rstrip() for line in drawn(overview, width, height, turn * TURN)]
        assert len(lines) <= height
        assert max(map(len, lines)) <= width
        first, second, third = lines[1:4]
        assert first.split()[:3] == ["one", "ADAPTED", "4"]
        assert first.endswith("yes")
        assert second.split() == ["two", "WAITING_FOR_DATA", "STARTING"]
        assert third.split() == ["three", "starting"]
        assert [line for line in lines if f" {name}: title " in line]
        assert sum(": title" in line for line in lines) == 1
