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
    """An injector file 10 % wrong in stiffness and nozzle."""
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
    masses.write_text("recording,mass_mg\nhealthy_1.csv,144.2\n")
    fitted = tmp_path / "fitted.toml"
    done = command.done("fit", *healthy, "--model", wrong, "--output", fitted, "--mass", masses, "--json")
    document = json.loads(done.out, parse_constant=lambda name: pytest.fail(name))
    assert (document["schema"], document["verdict"], document["level"]["from"]) == (1, "adequate", "measured_mass")
    assert (document["parameters"]["line.diameter"]["unit"], document["baseline"]["injections"]) == ("mm", 6)
    low, high = document["parameters"]["nozzle.flow_coefficient"]["ci95"]
    assert low < document["parameters"]["nozzle.flow_coefficient"]["value"] < high
    assert {one["phase"] for one in document["residuals"]} == {"standstill", "opening", "open", "closing", "after"}
    assert [one["measured_mass_mg"] for one in document["masses"]] == [None, pytest.approx(144.2)]
    assert all(one["name"].startswith("one lump") for one in document["structures"])  # for a lump explains it all
