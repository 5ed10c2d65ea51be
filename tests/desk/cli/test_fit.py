"""`observer-rt fit`: what it writes and prints, and the mistakes it names."""

import json
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.files.formats import write_recording
from tests.desk.cli.conftest import Command
from tests.identification.fit.healthy import simulations

POINTS = ((60e6, 0.6e-3), (140e6, 1.9e-3))


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("healthy")
    paths = []
    for number, simulation in enumerate(simulations(POINTS)):
        paths.append(folder / f"healthy_{number}.csv")
        write_recording(paths[-1], simulation.recording)
    return tuple(paths)


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    path = tmp_path / "injector.toml"
    text = NOMINAL_INJECTOR.read_text().replace("bulk_modulus_line = 1.6e9", "bulk_modulus_line = 1.44e9")
    path.write_text(text.replace("flow_coefficient = 0.78", "flow_coefficient = 0.858"))
    return path


def test_a_fit_writes_the_file_the_figure_and_says_what_it_is_worth(
    command: Command, healthy: tuple[Path, ...], wrong: Path, tmp_path: Path
) -> None:
    fitted, figure = tmp_path / "fitted.toml", tmp_path / "fit.png"
    done = command.done("fit", *healthy, "--model", wrong, "--output", fitted, "--plot", figure)
    for words in ("verdict: adequate", "one to one on A_L/(rho_L L_L)", "alpha_H", "chosen: one lump"):
        assert words in done.out
    assert "6 injections" not in done.err
    injector = load_injector(fitted)
    assert injector.fluid.bulk_modulus_line == pytest.approx(1.6e9, rel=0.005)
    assert injector.nozzle.flow_coefficient == pytest.approx(0.78, rel=0.01)
    assert injector.baseline is not None
    assert injector.baseline.adequate
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "--force" in command.refused("fit", *healthy, "--model", wrong, "--output", fitted)
    over_itself = ("fit", *healthy, "--model", wrong, "--output", wrong, "--force")
    assert "is the model that is fitted" in command.refused(*over_itself)
    command.done("evaluate", healthy[0], "--model", fitted, "--json")


def test_json_holds_all_of_it(command: Command, healthy: tuple[Path, ...], wrong: Path, tmp_path: Path) -> None:
    masses = tmp_path / "masses.csv"
    masses.write_text("recording,injection,mass_mg\nhealthy_1.csv,,135.9\nhealthy_0.csv,2,34.15\n")
    fitted = tmp_path / "fitted.toml"
    done = command.done("fit", *healthy, "--model", wrong, "--output", fitted, "--mass", masses, "--json")
    document = json.loads(done.out, parse_constant=lambda name: pytest.fail(name))
    assert (document["schema"], document["verdict"], document["level"]["from"]) == (1, "adequate", "measured_mass")
    assert (document["parameters"]["line.diameter"]["unit"], document["baseline"]["injections"]) == ("mm", 6)
    low, high = document["parameters"]["nozzle.flow_coefficient"]["ci95"]
    assert low < document["parameters"]["nozzle.flow_coefficient"]["value"] < high
    assert {one["phase"] for one in document["residuals"]} == {"standstill", "opening", "open", "closing", "after"}
    assert [one["measured_mass_mg"] for one in document["masses"]] == [None, pytest.approx(135.9)]
    (single,) = document["injections"]
    assert (Path(single["recording"]).name, single["injection"]) == ("healthy_0.csv", 2)
    assert single["mass_mg"]["fitted"] == pytest.approx(single["measured_mass_mg"], rel=0.005)
    assert all(one["name"].startswith("one lump") for one in document["structures"])  # for a lump explains it all


MAP = "p [bar];Pulse [µs];Menge [mm³/Hub]\n600;400;24,0\n600;800;46,5\n1000;400;33,5\n1000;800;59,5\n1400;800;69,0\n"


def test_a_map_of_masses_is_fitted_without_a_recording(
    command: Command, healthy: tuple[Path, ...], wrong: Path, tmp_path: Path
) -> None:
    table, mapped, figure = tmp_path / "map.csv", tmp_path / "mapped.toml", tmp_path / "map.svg"
    table.write_text(MAP, encoding="utf-8")
    words = ("fit", "--map", table, "--model", wrong, "--output", mapped)
    done = command.done(*words, "--plot", figure)
    assert "5 masses explained to" in done.out
    assert "masses tell little of" in done.out
    assert figure.read_text().lstrip().startswith("<?xml")
    injector = load_injector(mapped)
    assert injector.baseline is None
    assert injector.nozzle.flow_coefficient < 0.8
    document = json.loads(command.done(*words, "--force", "--json").out)
    coefficient = document["parameters"]["nozzle.flow_coefficient"]["value"]
    assert injector.nozzle.flow_coefficient == pytest.approx(coefficient, rel=1e-6)  # of seven digits
    assert [point["mass_mg"] for point in document["points"]] == pytest.approx([19.92, 38.595, 27.805, 49.385, 57.27])
    assert "two sources" in command.refused("fit", *healthy, *words[1:], "--force")
    assert "RECORDING: is missing" in command.refused("fit", *words[3:], "--force")
    table.write_text(MAP.replace("46,5", "x"), encoding="utf-8")
    assert f"{table}, line 3: 'x' mm3" in command.refused(*words, "--force")
