"""What is guessed of a file, shown and confirmed, or taken as it is by `--yes`."""

import io
import tomllib
from pathlib import Path

import pytest
from rich.console import Console

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.guessing import as_confirmed
from observer_rt.foundation.errors import UserError
from tests.device import simulated
from tests.files.layouts import LAYOUTS

OURS = simulated(3, 0.2, (60e6, 120e6), seed=5)


class Typed(io.StringIO):
    """A terminal's input."""

    def isatty(self) -> bool:
        return True


def made(folder: Path, name: str) -> Path:
    (layout,) = (each for each in LAYOUTS if each.name == name)
    path = layout.make(folder, OURS)
    assert isinstance(path, Path)
    return path


def terminal() -> Console:
    return Console(file=io.StringIO(), force_terminal=True, width=160, color_system=None)


def shown(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_terminal_is_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, console = made(tmp_path, "no names"), terminal()
    monkeypatch.setattr("sys.stdin", Typed("y\n"))
    bench = as_confirmed(load_bench(), [path], yes=False, console=console)
    assert bench is not None
    layout = bench.injector.config.recording
    assert layout is not None
    assert (layout.rail_pressure.column, layout.line_pressure.column, layout.rate_hz) == (2, 4, 50e3)
    assert "moves with the lift" in shown(console)
    section = shown(console).partition("bench file:\n")[2]
    assert tomllib.loads(section)["recording"]["line_pressure"] == {"column": 4, "unit": "bar"}


def test_who_does_not_agree_is_given_the_section(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", Typed("n\n"))
    with pytest.raises(UserError, match=r'\[recording\.needle_lift\]\ncolumn = "Nadelhub"'):
        as_confirmed(load_bench(), [made(tmp_path, "tabulators")], yes=False, console=terminal())


@pytest.mark.parametrize("name", ["exchanged names", "tabulators"])
def test_nobody_is_asked_who_has_agreed_or_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    path, console = made(tmp_path, name), Console(file=io.StringIO())
    agreed = as_confirmed(load_bench(), [path], yes=True, console=console)
    assert agreed is not None
    assert agreed.injector.config.recording is not None
    left = as_confirmed(load_bench(), [path], yes=False, console=console)
    assert left is not None
    assert left.injector.config.recording is None


def test_what_is_described_is_not_guessed(tmp_path: Path) -> None:
    layout = tmp_path / "layout.toml"
    layout.write_text(
        "[recording]\n"
        + "".join(
            f'[recording.{name}]\ncolumn = "{name}"\n'
            for name in ("rail_pressure", "needle_lift", "line_pressure")
        )
    )
    bench = load_bench(layout, off_bus=True)
    assert as_confirmed(bench, [tmp_path / "absent.csv"], yes=True, console=terminal()) is bench
    ours = made(tmp_path, "own CSV")
    assert as_confirmed(None, [ours], yes=True, console=terminal()) is None
