"""The user's files: what is read, and refusals that name file, key and remedy."""

import re
import tomllib
from pathlib import Path
from typing import get_args

import pytest
from pydantic import BaseModel

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, PACKAGE_DATA, load_bench, load_injector
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


def test_keys_of_earlier_versions_are_passed_over_with_the_one_value_they_could_have(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, f"{BENCH}[learning]\nlookahead = 4\n"))
    assert bench.injector.config == load_bench().injector.config
    error = bench_refusal(tmp_path, f"{BENCH}[learning]\nlookahead = 2\n")
    assert (error.place.endswith(": learning.lookahead"), error.problem) == (True, "unknown key")


PAPER = '[learning]\ntraining = "paper"\n'
REFUSED = [
    # unknown keys, of which the nearest is named
    *(
        (f"{BENCH}[{section}]\n{key} = 1\n", f"{section}.{key}", f"did you mean '{nearest}'?")
        for section, key, nearest in (
            ("link", "chanel", "channel"),
            ("sampling", "rate", "rate_hz"),
            ("learning", "event_gap", "event_gap_ms"),
            ("noise", "rail_pressure_mpa", "rail_pressure_MPa"),
            ("outputs", "injectionrate", "injection_rate"),
        )
    ),
    (BENCH.replace("file =", "fil ="), "dbc.0.fil", "'file'"),
    (BENCH.replace("pattern", "patern", 1), "signals.rail_pressure.patern", "'pattern'"),
    (BENCH + "[lerning]\nenabled = false\n", "lerning", "'learning'"),
    (BENCH.replace("[signals.needle_lift]", "[signals_]"), "signals_", "unknown key"),
    # missing keys
    (SIGNALS, "dbc", "is missing"),
    ('[[dbc]]\nfile = "observer_fd.dbc"\n', "signals", "is missing"),
    (BENCH.replace('message = "SampleBlock"\n', "", 1), "signals.rail_pressure.message", "is missing"),
    # values
    *(
        (f"{BENCH}[{section}]\n{line}\n", f"{section}.{line.split(' = ')[0]}", "not allowed")
        for section, line in (
            ("sampling", "rate_hz = 0"),
            ("sampling", "rate_hz = 10"),
            ("sampling", "rate_hz = nan"),
            ("sampling", 'rate_hz = "fast"'),
            ("noise", "needle_lift_um = -0.4"),
            ("noise", "line_pressure_MPa = inf"),
            ("learning", "event_gap_ms = 0"),
            ("learning", 'training = "none"'),
            ("outputs", "injector_id = 256"),
            ("link", "bit_rate = -1"),
            ("link", 'fd = "perhaps"'),
        )
    ),
    # what does not go together
    (BENCH.replace("pattern =", 'signal = "A"\npattern =', 1), "signals.rail_pressure", "exactly one"),
    (BENCH + PAPER, "learning", "needs 'identification_gain'"),
    (
        BENCH + "[learning]\nidentification_gain = 1e5\n",
        "learning",
        "no effect with training = 'prediction_error'",
    ),
    (BENCH + PAPER + "identification_gain = 0\n", "learning.identification_gain", "a number above 0"),
    (
        f'{BENCH}{PAPER}identification_gain = 1e5\n[sampling]\nmeaning = "mean"\n',
        "file",
        "knows no sampling.meaning = 'mean'",
    ),
]


@pytest.mark.parametrize(("text", "place", "said"), REFUSED, ids=[place for _, place, _ in REFUSED])
def test_mistakes_are_named(tmp_path: Path, text: str, place: str, said: str) -> None:
    error = bench_refusal(tmp_path, text)
    assert error.place.endswith(f": {place}")
    assert error.remedy
    assert said in f"{error.problem} {error.remedy}"


def test_the_training_of_the_paper_with_its_gain_is_read(tmp_path: Path) -> None:
    bench = load_bench(bench_file(tmp_path, BENCH + PAPER + "identification_gain = 5e4\n"))
    assert bench.injector.config.learning.identification_gain == 5e4


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file") as refused:
        load_bench(tmp_path / "none.toml")
    assert refused.value.place == str(tmp_path / "none.toml")
    for missing, key in (
        (BENCH + '[model]\nfile = "none.toml"\n', "model.file"),
        (BENCH.replace("observer_fd.dbc", "none.toml"), "dbc.0.file"),
    ):
        with pytest.raises(UserError, match="does not exist") as refused:
            load_bench(path := bench_file(tmp_path, missing))
        assert refused.value.place == f"{path}: {key}"
        assert str(tmp_path / "none.toml") in refused.value.problem


def test_file_that_is_no_toml(tmp_path: Path) -> None:
    error = bench_refusal(tmp_path, BENCH + "[link\n")
    assert "not valid TOML" in error.problem
    assert "line" in error.problem


def test_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="not UTF-8"):
        load_bench(path)
    with pytest.raises(UserError, match="cannot be read"):
        load_bench(tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "place", "said"),
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
            "is missing add it, a number of at least 0; `observer-rt run --print-example-injector`",
        ),
        ("[chamber]", "[chambre]", "chambre", "'chamber'"),
    ],
)
def test_mistakes_in_an_injector_file_are_named(
    tmp_path: Path, old: str, new: str, place: str, said: str
) -> None:
    error = injector_refusal(tmp_path, old, new)
    assert error.place.endswith(f": {place}")
    assert said in f"{error.problem} {error.remedy}"


def test_outflow_by_name(tmp_path: Path) -> None:
    path = injector_file(tmp_path, "[fluid]", 'line_outflow = "seat"\n[fluid]')
    assert load_injector(path).line_outflow is LineOutflow.SEAT


def test_parameters_do_not_change_once_read() -> None:
    injector: InjectorParameters = load_injector()
    with pytest.raises(ValueError, match="frozen"):
        injector.line.volume = 1.0
