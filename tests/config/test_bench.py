"""The user's files: what is read, and refusals that name file, key and remedy."""

import re
import tomllib
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from observer_rt.config.bench import (
    EXAMPLE_BENCH,
    NOMINAL_INJECTOR,
    PACKAGE_DATA,
    load_bench,
    load_injector,
)
from observer_rt.config.bench_file import BenchConfig, DatabaseConfig
from observer_rt.config.signals import Role, SignalConfig
from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import InjectorParameters, LineOutflow

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
    """The nominal injector with one line changed."""
    text = NOMINAL_INJECTOR.read_text()
    assert text.count(old) == 1, old
    path = folder / "injector.toml"
    path.write_text(text.replace(old, new))
    return path


def bench_refusal(folder: Path, text: str) -> UserError:
    path = bench_file(folder, text)
    with pytest.raises(UserError) as refused:
        load_bench(path)
    assert refused.value.place.startswith(str(path))
    assert refused.value.exit_code == 2
    return refused.value


def injector_refusal(folder: Path, old: str, new: str) -> UserError:
    path = injector_file(folder, old, new)
    with pytest.raises(UserError) as refused:
        load_injector(path)
    assert refused.value.place.startswith(str(path))
    assert refused.value.remedy
    return refused.value


def test_smallest_bench_file_has_the_defaults(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, BENCH))
    assert (bench.config, bench.injector.config) == (load_bench().config, load_bench().injector.config)
    assert bench.injector.parameters == load_injector()
    assert bench.databases == (PACKAGE_DATA / "observer_fd.dbc",)


def _keys(model: type[BaseModel]) -> dict[str, set[str]]:
    """Keys of every section of a bench file."""
    sections: dict[str, set[str]] = {}
    for name, field in model.model_fields.items():
        inner = field.annotation
        candidates = [inner, *get_args(inner)]
        nested = next((c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)), None)
        assert nested is not None, name
        sections[name] = set(nested.model_fields)
    return sections


def test_example_bench_shows_every_key_with_its_default(tmp_path: Path) -> None:
    """Each key is there, commented out where its default is nothing; and its value is the default."""
    text = EXAMPLE_BENCH.read_text()
    for section, keys in _keys(BenchConfig).items():
        expected = set(SignalConfig.model_fields) if section == "signals" else keys
        expected = set(DatabaseConfig.model_fields) if section == "dbc" else expected
        for key in expected:
            assert re.search(rf"\b{key}\b", text), f"{section}.{key} is not shown"
    shown = tomllib.loads(text)
    defaults = BenchConfig.model_validate({"dbc": shown["dbc"], "signals": shown["signals"]})
    example = load_bench(EXAMPLE_BENCH)
    assert {**dict(example.config), **dict(example.injector.config)} == dict(defaults)
    for section in ("link", "sampling", "noise", "outputs", "learning"):
        model = type(getattr(defaults, section))
        assert set(shown[section]) == {n for n, f in model.model_fields.items() if f.default is not None}


def test_example_injector_is_the_nominal_one() -> None:
    injector = load_injector(NOMINAL_INJECTOR)
    assert injector.line_outflow is LineOutflow.NOZZLE
    assert injector.line.model == "lump"
    assert injector.nozzle.sac_volume == 75e-9
    assert injector.chamber.pressure == 5e6


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


NEAREST = {
    "link.chanel": "channel",
    "sampling.rate": "rate_hz",
    "learning.event_gap": "event_gap_ms",
    "noise.rail_pressure_mpa": "rail_pressure_MPa",
    "outputs.injectionrate": "injection_rate",
}


@pytest.mark.parametrize(("place", "nearest"), NEAREST.items())
def test_unknown_key_names_the_nearest(tmp_path: Path, place: str, nearest: str) -> None:
    section, key = place.split(".")
    error = bench_refusal(tmp_path, f"{BENCH}[{section}]\n{key} = 1\n")
    assert error.place.endswith(f": {place}")
    assert error.problem == "unknown key"
    assert f"did you mean '{nearest}'?" in error.remedy


@pytest.mark.parametrize(
    ("section", "only", "other"),
    [("learning.lookahead", "4", "2")],
)
def test_keys_of_earlier_versions_are_passed_over_with_the_one_value_they_could_have(
    tmp_path: Path, section: str, only: str, other: str
) -> None:
    name, key = section.split(".")
    bench = load_bench(bench_file(tmp_path, f"{BENCH}[{name}]\n{key} = {only}\n"))
    assert bench.injector.config == load_bench().injector.config
    error = bench_refusal(tmp_path, f"{BENCH}[{name}]\n{key} = {other}\n")
    assert (error.place.endswith(f": {section}"), error.problem) == (True, "unknown key")


def test_means_are_not_for_the_training_of_the_paper(tmp_path: Path) -> None:
    learning = '[learning]\ntraining = "paper"\nidentification_gain = 1e5\n'
    load_bench(bench_file(tmp_path, f"{BENCH}{learning}"))
    error = bench_refusal(tmp_path, f'{BENCH}{learning}[sampling]\nmeaning = "mean"\n')
    assert "knows no sampling.meaning = 'mean'" in error.problem


def test_unknown_key_in_a_list_and_deep_down(tmp_path: Path) -> None:
    error = bench_refusal(tmp_path, BENCH.replace("file =", "fil ="))
    assert error.place.endswith(": dbc.0.fil")
    assert "'file'" in error.remedy
    error = bench_refusal(tmp_path, BENCH.replace("pattern", "patern", 1))
    assert error.place.endswith(": signals.rail_pressure.patern")
    assert "'pattern'" in error.remedy


def test_unknown_section(tmp_path: Path) -> None:
    error = bench_refusal(tmp_path, BENCH + "[lerning]\nenabled = false\n")
    assert error.place.endswith(": lerning")
    assert "'learning'" in error.remedy


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (SIGNALS, "dbc"),
        ('[[dbc]]\nfile = "observer_fd.dbc"\n', "signals"),
        (BENCH.replace("[signals.needle_lift]", "[signals_]"), "signals_"),
        (BENCH.replace('message = "SampleBlock"\n', "", 1), "signals.rail_pressure.message"),
    ],
)
def test_missing_keys(tmp_path: Path, text: str, place: str) -> None:
    error = bench_refusal(tmp_path, text)
    assert error.place.endswith(f": {place}")
    assert error.remedy


@pytest.mark.parametrize(
    ("lines", "place"),
    [
        ("[sampling]\nrate_hz = 0\n", "sampling.rate_hz"),
        ("[sampling]\nrate_hz = 10\n", "sampling.rate_hz"),
        ("[sampling]\nrate_hz = nan\n", "sampling.rate_hz"),
        ('[sampling]\nrate_hz = "fast"\n', "sampling.rate_hz"),
        ("[noise]\nneedle_lift_um = -0.4\n", "noise.needle_lift_um"),
        ("[noise]\nline_pressure_MPa = inf\n", "noise.line_pressure_MPa"),
        ("[learning]\nevent_gap_ms = 0\n", "learning.event_gap_ms"),
        ('[learning]\ntraining = "none"\n', "learning.training"),
        ("[outputs]\ninjector_id = 256\n", "outputs.injector_id"),
        ("[link]\nbit_rate = -1\n", "link.bit_rate"),
        ('[link]\nfd = "perhaps"\n', "link.fd"),
    ],
)
def test_values_that_are_not_allowed(tmp_path: Path, lines: str, place: str) -> None:
    error = bench_refusal(tmp_path, BENCH + lines)
    assert error.place.endswith(f": {place}")
    assert "not allowed" in error.problem
    assert error.remedy


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ('[learning]\ntraining = "paper"\n', "needs 'identification_gain'"),
        ("[learning]\nidentification_gain = 1e5\n", "no effect with training = 'prediction_error'"),
        ('[learning]\ntraining = "paper"\nidentification_gain = 0\n', "greater than 0"),
    ],
)
def test_identification_gain_belongs_to_the_training_of_the_paper(
    tmp_path: Path, lines: str, problem: str
) -> None:
    error = bench_refusal(tmp_path, BENCH + lines)
    assert ": learning" in error.place
    assert problem in error.problem
    bench = load_bench(
        bench_file(tmp_path, BENCH + '[learning]\ntraining = "paper"\nidentification_gain = 5e4\n')
    )
    assert bench.injector.config.learning.identification_gain == 5e4


def test_one_way_to_name_the_samples(tmp_path: Path) -> None:
    error = bench_refusal(tmp_path, BENCH.replace("pattern =", 'signal = "A"\npattern =', 1))
    assert error.place.endswith(": signals.rail_pressure")
    assert "exactly one" in error.problem


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file") as refused:
        load_bench(tmp_path / "none.toml")
    assert refused.value.place == str(tmp_path / "none.toml")
    with pytest.raises(UserError, match="no such file") as refused:
        load_bench(bench_file(tmp_path, BENCH + '[model]\nfile = "none.toml"\n'))
    assert refused.value.place == str(tmp_path / "none.toml")


def test_file_that_is_no_toml(tmp_path: Path) -> None:
    error = bench_refusal(tmp_path, BENCH + "[link\n")
    assert "not valid TOML" in error.problem
    assert "line" in error.problem


def test_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="cannot be read"):
        load_bench(path)
    with pytest.raises(UserError, match="cannot be read"):
        load_bench(tmp_path)


@pytest.mark.parametrize(
    ("place", "usual", "impossible"),
    [
        ("line.volume", "0.9e-6 ", -0.9e-6),
        ("nozzle.sac_volume", "0.075e-6", 0.0),
        ("fluid.density_line", "830.0", "nan"),
        ("nozzle.holes", "8", 7.5),
        ("seat.cone_angle", "60.0", 180.0),
        ("seat.max_lift", "0.30e-3", '"0.3 mm"'),
    ],
)
def test_injector_with_impossible_values(
    tmp_path: Path, place: str, usual: str, impossible: str | float
) -> None:
    key = place.split(".")[1]
    error = injector_refusal(tmp_path, f"{key} = {usual}", f"{key} = {impossible} ")
    assert error.place.endswith(f": {place}")
    assert "not allowed" in error.problem


def test_injector_with_an_unknown_model_of_the_line(tmp_path: Path) -> None:
    error = injector_refusal(tmp_path, "loss_factor = 8.0", 'loss_factor = 8.0\nmodel = "wavy"')
    assert error.place.endswith(": line.model")
    assert "not allowed" in error.problem


def test_injector_with_an_unknown_key(tmp_path: Path) -> None:
    error = injector_refusal(tmp_path, "\nloss_factor =", "\nlos_factor =")
    assert error.place.endswith(": line.los_factor")
    assert "did you mean 'loss_factor'?" in error.remedy


def test_injector_with_a_missing_key_or_section(tmp_path: Path) -> None:
    error = injector_refusal(tmp_path, "loss_factor = 8.0", "")
    assert error.place.endswith(": line.loss_factor")
    assert error.problem == "is missing"
    assert "--print-example-injector" in error.remedy
    assert injector_refusal(tmp_path, "[chamber]", "[chambre]").place.endswith(": chambre")


def test_outflow_by_name(tmp_path: Path) -> None:
    path = injector_file(tmp_path, "[fluid]", 'line_outflow = "seat"\n[fluid]')
    assert load_injector(path).line_outflow is LineOutflow.SEAT


def test_parameters_do_not_change_once_read() -> None:
    injector: InjectorParameters = load_injector()
    with pytest.raises(ValueError, match="frozen"):
        injector.line.volume = 1.0
