"""The user's files: their content, what they say otherwise than before, refusals that name file, key and remedy."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from observer_rt.config.bench import (
    EXAMPLE_BENCH,
    NOMINAL_INJECTOR,
    PACKAGE_DATA,
    changes,
    content_of,
    load_bench,
    load_injector,
)
from observer_rt.config.bench_file import BusesConfig, DatabaseConfig
from observer_rt.config.injector_sections import InjectorConfig
from observer_rt.config.signals import OPTIONAL_SIGNALS, OptionalRole, Role, SignalConfig, SignalsConfig
from observer_rt.foundation.errors import UserError

SIGNALS = "".join(
    f'[signals.{role}]\nmessage = "SampleBlock"\npattern = "{name}_{{:02d}}"\n'
    for role, name in zip(Role, ("RailPressure", "NeedleLift", "LinePressure"), strict=True)
)
BENCH = f'[[dbc]]\nfile = "observer_fd.dbc"\n{SIGNALS}'


def bench_file(folder: Path, text: str) -> Path:
    path = folder / "bench.toml"
    path.write_text(text)
    return path


def injector_file(folder: Path, old: str, new: str) -> Path:
    text = NOMINAL_INJECTOR.read_text()
    assert text.count(old) == 1, old
    path = folder / "injector.toml"
    path.write_text(text.replace(old, new))
    return path


def require_refusal(load: Callable[[Path], object], path: Path, location: str, said: str) -> None:
    with pytest.raises(UserError) as refused:
        load(path)
    error = refused.value
    assert (error.location, error.exit_code) == (f"{path}: {location}", 2)
    assert error.remedy
    assert said in f"{error.problem} {error.remedy}"


def require_bench_refusal(folder: Path, text: str, location: str, said: str) -> None:
    require_refusal(load_bench, bench_file(folder, text), location, said)


def test_smallest_bench_file_has_the_defaults(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, BENCH))
    assert (bench.config, bench.injector.config) == (load_bench().config, load_bench().injector.config)
    assert bench.injector.parameters == load_injector()
    assert bench.databases == (PACKAGE_DATA / "observer_fd.dbc",)


def _keys(model: type[BaseModel]) -> dict[str, set[str]]:
    sections: dict[str, set[str]] = {}
    for name, field in model.model_fields.items():
        inner = field.annotation
        candidates = [inner, *get_args(inner)]
        nested = next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), None)
        assert nested is not None, name
        sections[name] = set(nested.model_fields)
    return sections


def test_example_bench_shows_every_key_with_its_default() -> None:
    """Each key is there, commented out where its default is nothing; and its value is the default."""
    text = EXAMPLE_BENCH.read_text()
    for section, keys in {**_keys(BusesConfig), **_keys(InjectorConfig)}.items():
        expected = set(SignalConfig.model_fields) if section == "signals" else keys
        expected = set(DatabaseConfig.model_fields) if section == "dbc" else expected
        for key in expected:
            assert re.search(rf"\b{key}\b", text), f"{section}.{key} is not shown"
    shown = tomllib.loads(text)
    buses = BusesConfig.model_validate({"dbc": shown["dbc"]})
    injector = InjectorConfig.model_validate({"signals": shown["signals"]})
    example, defaults = load_bench(EXAMPLE_BENCH), {**dict(buses), **dict(injector)}
    assert (example.config, example.injector.config) == (buses, injector)
    for section in ("link", "sampling", "noise", "outputs", "learning"):
        model = type(defaults[section])
        assert set(shown[section]) == {n for n, f in model.model_fields.items() if f.default is not None}


def test_files_are_found_beside_the_bench_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(NOMINAL_INJECTOR.read_text().replace("holes = 8", "holes = 7"))
    (tmp_path / "mine.dbc").write_bytes((PACKAGE_DATA / "observer_fd.dbc").read_bytes())
    text = BENCH.replace("observer_fd.dbc", "mine.dbc") + '[model]\nfile = "mine.toml"\n'
    bench = load_bench(bench_file(tmp_path, text))
    assert bench.injector.parameters.nozzle.holes == 7
    assert bench.databases == (tmp_path / "mine.dbc",)
    assert load_bench(bench.path, model=NOMINAL_INJECTOR).injector.parameters.nozzle.holes == 8


def test_database_beside_the_bench_file_wins_over_the_shipped_one(tmp_path: Path) -> None:
    (tmp_path / "observer_fd.dbc").write_text("")
    assert load_bench(bench_file(tmp_path, BENCH)).databases == (tmp_path / "observer_fd.dbc",)


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"^{tmp_path / 'none.toml'}: no such file"):
        load_bench(tmp_path / "none.toml")
    with pytest.raises(UserError, match="cannot be read"):
        load_bench(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "location", "said"),
    [
        ("volume = 0.9e-6 ", "volume = -0.9e-6 ", "line.volume", "not allowed"),
        ("sac_volume = 0.075e-6", "sac_volume = 0.0", "nozzle.sac_volume", "not allowed"),
        ("density_line = 830.0", "density_line = nan", "fluid.density_line", "not allowed"),
        ("holes = 8", "holes = 7.5", "nozzle.holes", "not allowed"),
        ("cone_angle = 60.0", "cone_angle = 180.0", "seat.cone_angle", "not allowed"),
        ("max_lift = 0.30e-3", 'max_lift = "0.3 mm"', "seat.max_lift", "not allowed"),
        ("loss_factor = 8.0", 'loss_factor = 8.0\nmodel = "wavy"', "line.model", "not allowed"),
        ("\nloss_factor =", "\nlos_factor =", "line.los_factor", "did you mean 'loss_factor'?"),
        (
            "loss_factor = 8.0",
            "",
            "line.loss_factor",
            "is missing add it; `observer-rt run --print-example-injector`",
        ),
        ("[chamber]", "[chambre]", "chambre", "'chamber'"),
        ("format = 1 ", "format = 2 ", "format", "a later version"),
        ("format = 1 ", "format = 0 ", "format", "no such format"),
    ],
)
def test_mistakes_in_an_injector_file_are_named(tmp_path: Path, old: str, new: str, location: str, said: str) -> None:
    require_refusal(load_injector, injector_file(tmp_path, old, new), location, said)


LAYOUT = """
[recording.time]
column = "Zeit"
[recording.rail_pressure]
column = "p_Rail"
[recording.needle_lift]
column = "Hub"
[recording.line_pressure]
column = "p_Line"
[signals.needle_lift]
delay_us = 20.0
"""


@pytest.mark.parametrize(
    ("off_bus", "more", "is_enough"),
    [(True, "", True), (False, "", False), (True, '[link]\nchannel = "can1"\n', False)],
)
def test_for_files_a_layout_is_all_it_takes(tmp_path: Path, off_bus: bool, more: str, is_enough: bool) -> None:
    """On a bus, or where one is stated, the databases are missing."""
    path = tmp_path / "layout.toml"
    path.write_text(LAYOUT + more)
    if not is_enough:
        with pytest.raises(UserError, match="dbc: is missing"):
            load_bench(path, off_bus=off_bus)
        return
    config = load_bench(path, off_bus=off_bus).injector.config
    assert config.recording is not None
    assert config.recording.time is not None
    assert config.recording.time.column == "Zeit"
    example = load_bench().injector.config
    assert config.signals.needle_lift == example.signals.of(Role.NEEDLE_LIFT).model_copy(update={"delay_us": 20.0})
    assert config.sampling == example.sampling


def test_sections_and_files_that_changed_are_named(tmp_path: Path) -> None:
    injector, database, path = (tmp_path / name for name in ("injector.toml", "mine.dbc", "bench.toml"))
    injector.write_text(NOMINAL_INJECTOR.read_text())
    database.write_bytes(EXAMPLE_BENCH.with_name("observer_fd.dbc").read_bytes())
    text = EXAMPLE_BENCH.read_text().replace('"observer_fd.dbc"', '"mine.dbc"', 1)
    path.write_text(text.replace("# file = ", "file = ", 1))
    before = content_of(load_bench(path))
    assert changes(before, content_of(load_bench(path))) == []
    path.write_text(path.read_text().replace("bridge_ms = 0.5", "bridge_ms = 1").replace('"can0"', '"can1"', 1))
    injector.write_text(injector.read_text().replace("holes = 8", "holes = 9"))
    database.write_bytes(database.read_bytes() + b"\n")
    changed = ["link", "sampling", "injector file", str(database)]
    assert changes(before, content_of(load_bench(path))) == changed


@pytest.mark.parametrize("role", OptionalRole)
def test_every_role_has_row_section_and_example(role: OptionalRole) -> None:
    row = OPTIONAL_SIGNALS[role]
    assert row.units is None or row.origins is None
    assert row.possible[0] <= row.possible[1]
    assert role.value in SignalsConfig.model_fields
    assert f"[signals.{role.value}]" in EXAMPLE_BENCH.read_text("utf-8")
