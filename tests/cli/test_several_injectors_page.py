"""The page on several injectors: its bench file is one, its commands do what it says."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import load_bench
from observer_rt.recording.formats import read_recording
from tests import engine
from tests.cli.conftest import Command
from tests.pages import needs_bus, words_of


@pytest.mark.slow
def test_the_commands_that_need_no_bus(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    engine.write_bench(tmp_path)
    for words in engine.make_log():
        command.done(*words)
    engine.merge_logs(tmp_path)
    command.done("convert", "engine.log", "engine.blf")
    (tmp_path / "right.csv").unlink()
    for line in engine.PAGE.commands:
        if not needs_bus(line):
            command.done(*words_of(line)[0])
    assert {"engine_left.png", "engine_right.png", "right.csv"} <= {path.name for path in tmp_path.iterdir()}
    assert read_recording(tmp_path / "right.csv").samples > 10_000


def test_the_variant_with_one_bus(tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text(engine.on_one_bus(tmp_path))
    (tmp_path / "right.toml").write_text(engine.NOMINAL_INJECTOR.read_text())
    sent = [(layout.name, layout.frame_id) for layout in map_bench(load_bench(tmp_path / "one.toml")).sent]
    assert sent == [
        (name, identifier + step)
        for step in (0, 0x10)
        for name, identifier in (
            ("InjectionRate", 0x300),
            ("InjectionSummary", 0x301),
            ("ObserverStatus", 0x302),
        )
    ]
