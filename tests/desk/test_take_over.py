"""Taking an amended model over: the bench file names it and keeps all else, and each step can be undone."""

import shutil
from pathlib import Path

import pytest
import tomlkit

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench
from observer_rt.desk.take_over import reload_daemon, steps, take_over, undo
from observer_rt.foundation.errors import UserError


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    shutil.copyfile(EXAMPLE_BENCH, path)
    return path


def amended(folder: Path, v_h: float) -> Path:
    """An injector file with a worn nozzle in force."""
    document = tomlkit.parse(NOMINAL_INJECTOR.read_text())
    effect = {"id": "orifice_area", "parameters": {"v_H": {"value": v_h, "unit": "-"}}}
    document["effects"] = [effect]
    path = folder / f"amended_{v_h}.toml"
    path.write_text(tomlkit.dumps(document))
    return path


def worn(bench: Path, injector: str | None = None) -> float:
    """Wear of the nozzle in force."""
    effects = load_bench(bench).of(injector).injector.parameters.effects
    return effects[0].parameters["v_H"].value if effects else 0.0


def test_each_step_is_undone_in_turn_to_the_letter(bench: Path, tmp_path: Path) -> None:
    texts = [bench.read_text()]
    for v_h in (0.1, 0.2):
        take_over(load_bench(bench), amended(tmp_path, v_h))
        assert worn(bench) == v_h
        texts.append(bench.read_text())
    assert [step.after for step in steps(bench)] == [
        "crin3_nominal_amended_1.toml",
        "crin3_nominal_amended_2.toml",
    ]
    amended(tmp_path, 0.2).unlink()  # what was taken over is a copy
    assert worn(bench) == 0.2
    undo(bench)
    assert (worn(bench), bench.read_text()) == (0.1, texts[1])
    undo(bench)
    assert worn(bench) == 0.0
    assert [line for line in bench.read_text().splitlines() if line] == [
        line for line in texts[0].splitlines() if line
    ]
    with pytest.raises(UserError, match="no model was taken over"):
        undo(bench)


def test_one_of_several_injectors_has_its_own_model(bench: Path, tmp_path: Path) -> None:
    text = bench.read_text() + "\n[injectors.left]\n[injectors.right.outputs]\ninjector_id = 9\n"
    bench.write_text(text)
    take_over(load_bench(bench).of("left"), amended(tmp_path, 0.1))
    assert (worn(bench, "left"), worn(bench, "right")) == (0.1, 0.0)
    undo(bench, "left")
    assert worn(bench, "left") == 0.0


def test_what_cannot_be_served_leaves_the_bench_as_it_is(bench: Path, tmp_path: Path) -> None:
    before = bench.read_text()
    broken = amended(tmp_path, 0.1)
    broken.write_text(broken.read_text().replace("orifice_area", "orifice_aera"))
    with pytest.raises(UserError, match="orifice_aera"):
        take_over(load_bench(bench), broken)
    with pytest.raises(UserError, match="in force already"):
        take_over(load_bench(bench), NOMINAL_INJECTOR)
    assert bench.read_text() == before
    assert steps(bench) == []


def test_no_daemon_is_told_where_none_runs(bench: Path) -> None:
    assert reload_daemon(load_bench(bench)) is None


def test_the_copy_takes_the_place_of_no_file(bench: Path, tmp_path: Path) -> None:
    mine = bench.parent / "crin3_nominal_amended_1.toml"
    mine.write_text("mine")
    assert take_over(load_bench(bench), amended(tmp_path, 0.1)).after == "crin3_nominal_amended_2.toml"
    assert mine.read_text() == "mine"
