"""README and docs: every command that needs no bus is run as it stands; others in test_on_vcan_pages.py."""

import csv
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import tools.benchmarks.__main__  # noqa: F401
from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import read_recording, write_recording
from observer_rt.model.effects import sized
from tests import own_injector, several_injectors
from tests.desk.cli.conftest import Command, document
from tests.files.layouts import text as text_of
from tests.kept_evidence import keep
from tests.pages import PAGES, ROOT, Page, needs_bus, serves_a_page, words_of

SEVERAL_POINTS = ("--rail-pressure", "60,140", "--energizing-time", "0.6,1.9", "--injections", 4)
WORN = ("--effect", "orifice_area:v_H=0.3")


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Command) -> Path:
    """The folder of somebody who follows the pages: their recordings are simulated with the shipped files."""
    monkeypatch.chdir(tmp_path)
    Path("bench.toml").write_text(command("run", "--print-example-bench").out)
    Path("injector.toml").write_text(command("run", "--print-example-injector").out)
    return tmp_path


def done(command: Command, line: str) -> str:
    """What a line of a page prints, which is in the file that it names, if any."""
    words, into = words_of(line)
    text = command.done(*words).out
    if into is not None:
        into.write_text(text)
    return text


def run_all(command: Command, commands: list[str]) -> None:
    for line in commands:
        done(command, line)


def without_bus(page: Page) -> list[str]:
    return [
        line
        for line in page.commands
        if line.startswith("observer-rt ") and not needs_bus(line) and not serves_a_page(line)
    ]


@pytest.mark.slow
def test_the_commands_on_many_recordings(command: Command, desk: Path) -> None:
    for name, effect in (("a", ()), ("b", WORN)):
        path = desk / "measured" / f"injector_{name}" / "run_20260301_120000.csv"
        path.parent.mkdir(parents=True)
        command.done("simulate", *SEVERAL_POINTS, *effect, "--output", path)
    run_all(command, without_bus(Page("docs/batch.md")))
    assert (desk / "trend.png").exists()


@pytest.mark.slow
def test_the_commands_on_recordings(command: Command, desk: Path) -> None:
    page = Page("docs/recordings.md")
    command.done("simulate", *SEVERAL_POINTS, *WORN, "--output", "worn.csv")
    command.done("convert", "worn.csv", "made.log", "--bench", "bench.toml")
    command.done("convert", "made.log", "bus.blf")
    write_mine(page, Path("worn.csv"))
    Path("my.csv").write_text(text_of(read_recording(Path("worn.csv"))))
    run_all(command, without_bus(page))
    mine, worn = read_recording(Path("mine.mf4")), read_recording(Path("worn.csv"))
    np.testing.assert_allclose(mine.needle_lift, worn.needle_lift, atol=1e-8)
    np.testing.assert_allclose(mine.rail_pressure, worn.rail_pressure, rtol=1e-4)


@pytest.mark.slow
def test_the_commands_for_other_tools(command: Command, desk: Path) -> None:
    command.done("simulate", "--injections", 4, *WORN, "--output", "worn.csv")
    command.done("convert", "worn.csv", "made.log", "--bench", "bench.toml")
    command.done("convert", "made.log", "bus.blf")
    run_all(command, without_bus(Page("docs/measurement-tools.md")))
    assert {"signals.mf4", "trace.mf4"} <= {path.name for path in desk.iterdir()}


@pytest.mark.slow
def test_the_commands_on_evidence(command: Command, desk: Path) -> None:
    page = Page("docs/evidence.md")
    (section,) = page.fenced("toml")
    text = re.sub(r"^\[evidence\]\n(?:.+\n)*", lambda _: section, EXAMPLE_BENCH.read_text(), flags=re.M)
    Path("bench.toml").write_text(text)
    keep(load_bench(Path("bench.toml")), sized("rail_pressure_sensor_gain", g=0.02))
    before = load_bench(Path("bench.toml")).injector.parameters
    *first, undo = without_bus(page)
    run_all(command, first)
    amended = load_bench(Path("bench.toml")).injector.parameters
    assert [effect.id for effect in amended.effects] == ["rail_pressure_sensor_gain"]
    run_all(command, [undo])
    assert load_bench(Path("bench.toml")).injector.parameters == before


def write_mine(page: Page, like: Path) -> None:
    """A file in the layout of the page's `[recording]`, which goes into the bench file."""
    (section,) = page.fenced("toml")
    Path("bench.toml").write_text(EXAMPLE_BENCH.read_text() + section)
    recording, mapped = read_recording(like), tomllib.loads(section)["recording"]
    lift = mapped["needle_lift"]
    columns = {
        mapped["time"]["column"]: recording.time * 1e3,
        mapped["rail_pressure"]["column"]: recording.rail_pressure / 1e5,
        lift["column"]: (recording.needle_lift * 1e6 - lift["offset"]) / lift["factor"],
        f"{mapped['line_pressure']['column']} [MPa]": recording.line_pressure / 1e6,
    }
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt("mine.csv", rows, "%.9g", ";", header=";".join(columns), comments="")


def test_the_description_of_the_package_has_no_link_into_the_repository() -> None:
    """On a package index it would lead nowhere."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    text = Page("README.md").text
    for substitution in project["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(substitution["pattern"], substitution["replacement"], text)
    assert re.findall(r"\]\((?!https?:)", text) == []
    assert "`docs/operating.md` of the sources" in text


def test_the_extras_that_are_installed_are_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = {
        name
        for page in PAGES
        for extras in re.findall(r"pip install .*\[([\w,]+)\]", page.text)
        for name in extras.split(",")
    }
    assert {"batch", "desk", "monitor"} <= named <= set(project["optional-dependencies"])


def test_the_readme_is_a_screen_and_a_half() -> None:
    assert len(Page("README.md").text.splitlines()) <= 90


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.path)
def test_links_lead_somewhere(page: Page) -> None:
    targets = re.findall(r"\]\((?!https?:)([^)#\s]+)", page.text)
    assert [target for target in targets if not (ROOT / page.path).parent.joinpath(target).exists()] == []


@pytest.mark.slow
def test_the_commands_of_a_fit(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own_injector.write_files(tmp_path)  # with a map of masses
    commands = [line for line in Page("docs/fit.md").commands if "healthy_*" not in line]
    assert len(commands) == 5
    run_all(command, commands)
    assert Path("map.png").exists()
    assert Path("fitted.toml").exists()
    assert Path("fit.png").exists()


def test_the_first_commands_of_a_discovery_are_those_of_the_readme() -> None:
    """Which test_tutorial.py runs; options may stand in another order."""
    first, *others = (words_of(line)[0] for line in Page("docs/discovery.md").commands[:4])
    assert first[:2] == ["discover", "--out"]  # the same with other files
    assert [*map(sorted, others)] == [sorted(words_of(line)[0]) for line in without_bus(Page("README.md"))[-3:]]


@pytest.mark.slow
def test_from_unknown_to_the_daemon(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = Page("docs/discovery.md")
    simulate_plugged, discover_plugged, evaluate_amended = (words_of(line)[0] for line in page.commands[4:7])
    plugged = NOMINAL_INJECTOR.read_text(encoding="utf-8") + (
        '\n[[terms]]\nequation = "nozzle_flow"\nlaw = "-0.15 * (time_since_opening > 0.6)"\n'
    )
    Path("plugging.toml").write_text(plugged, encoding="utf-8")
    command.done(*simulate_plugged)
    result = command.done(*discover_plugged).out
    table = command.done(*evaluate_amended).out
    [proposal] = re.findall(r"^ +proposal 1: as if the nozzle lost 15.0 % of its flow .*$", page.text, re.MULTILINE)
    assert proposal.strip() in " ".join(result.split())
    rows = re.findall(r"^ +( [456]   .* yes)$", page.text, re.MULTILINE)
    assert (len(rows), [row for row in rows if row not in table]) == (3, [])


LIBRARY = Page("docs/library.md")
PROGRAMS = LIBRARY.fenced("python")


def printed(program: str, folder: Path) -> list[str]:
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


@pytest.mark.slow
def test_programs_do_what_the_page_says(tmp_path: Path) -> None:
    first, loop, recorded, reported, framed = PROGRAMS
    made = simulate(load_injector(), make_schedule([100e6], 3, 0.05, [1.1e-3]), 100e3, noise=SimulatedNoise())
    write_recording(tmp_path / "worn.csv", made.recording)
    *lines, lag = printed(recorded + reported, tmp_path)
    assert [re.sub(r"\d+\.\d mg", "x mg", line) for line in lines] == [f"{n}: x mg valid" for n in (1, 2, 3)]
    assert re.fullmatch(r"\{'value': \S+, 'ci95': \[\S+, \S+\], 'unit': 's'\}", lag)
    assert printed(framed, tmp_path) == ["1 frame with a wrong CRC"]
    heading, *rows = printed(first, tmp_path)
    assert heading.split() == ["mass_mg", "mass_bound_mg", "valid"]
    assert [row.split()[-1] for row in rows] == ["True"] * 3
    assert (tmp_path / "worn.png").exists()
    assert printed(loop, tmp_path)[0].startswith("named: seat_area")


@pytest.mark.slow
def test_the_model_agrees_with_others_measurements_as_far_as_the_page_says(tmp_path: Path) -> None:
    page = Page("docs/validation.md")
    program = ROOT / "docs/validation/compare.py"
    made = "\n".join(printed(f"import runpy; runpy.run_path({str(program)!r})", tmp_path))
    spray, *masses = (float(number) for number in re.findall(r"([+-][\d.]+)%", made))
    said = [float(number) for block in page.indented() for number in re.findall(r"([+-][\d.]+)%", block)]
    np.testing.assert_allclose([spray, *masses], said, atol=1.0)
    assert (abs(spray) < 2.0, np.abs(masses).reshape(3, 3)[:, 1].max() < 4.0) == (True, True)
    assert (tmp_path / "validation.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_commands_on_several_injectors(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    several_injectors.write_bench(tmp_path)
    for words in several_injectors.make_log():
        command.done(*words)
    several_injectors.merge_logs(tmp_path)
    command.done("convert", "engine.log", "engine.blf")
    (tmp_path / "right.csv").unlink()
    for line in several_injectors.PAGE.commands:
        if line.startswith("observer-rt ") and not needs_bus(line):
            command.done(*words_of(line)[0])
    assert {"left.png", "right.csv"} <= {path.name for path in tmp_path.iterdir()}
    assert read_recording(tmp_path / "right.csv").samples > 10_000


def test_the_variant_with_one_bus(tmp_path: Path) -> None:
    (tmp_path / "one.toml").write_text(several_injectors.on_one_bus(tmp_path))
    (tmp_path / "right.toml").write_text(NOMINAL_INJECTOR.read_text())
    sent = [(layout.name, layout.frame_id) for layout in map_bench(load_bench(tmp_path / "one.toml")).sent]
    assert sent == [
        (name, identifier + step)
        for step in (0, 0x10)
        for name, identifier in (("InjectionRate", 0x300), ("InjectionSummary", 0x301), ("ObserverStatus", 0x302))
    ]


@pytest.mark.slow
def test_the_page_on_ones_own_injector(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own_injector.write_files(tmp_path)
    for line in own_injector.PAGE.commands:
        if line.startswith(("sudo", "tools/")) or needs_bus(line):
            continue  # tests/daemon/test_on_vcan_pages.py
        text = done(command, line)
        if line == own_injector.PRINT_BENCH:
            own_injector.change_bench(tmp_path / "bench.toml")
        elif "check --bench" in line:
            assert "fitted.toml: adequate" in " ".join(text.split())
    the_fit_is_as_the_page_says()
    the_worn_injector_is(document(command, "worn.csv", "--model", "fitted.toml")["recordings"][0]["injections"])
    assert json.loads(Path("found/findings.json").read_text())["verdict"] == "named"


def the_fit_is_as_the_page_says() -> None:
    plant, by_file, fitted = (load_injector(Path(name)) for name in ("plant.toml", "by_file.toml", "fitted.toml"))
    for item in (by_file, fitted):
        assert (item.line_outflow, item.line.model) == (plant.line_outflow, plant.line.model)
        assert item.baseline is not None
        assert item.baseline.adequate
    assert by_file.line.diameter == 2.4e-3
    assert fitted.line.diameter == pytest.approx(plant.line.diameter, rel=0.005)
    assert fitted.nozzle.flow_coefficient == pytest.approx(plant.nozzle.flow_coefficient, rel=0.01)
    assert fitted.fluid.bulk_modulus_line == pytest.approx(plant.fluid.bulk_modulus_line, rel=0.01)


def the_worn_injector_is(injections: list[dict[str, float]]) -> None:
    assert [bool(injection["valid"]) for injection in injections] == [True] * 6
    with Path("worn.csv.truth.csv").open() as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    for injection in injections:
        first = int(injection["start_index"])
        rates = [row["injection_rate_mm3_per_ms"] for row in rows[first - 100 : first + 2000]]
        assert injection["mass_mg"] == pytest.approx(sum(rates) * 0.01 * 0.83, rel=0.006)
