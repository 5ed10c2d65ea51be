"""A project's folder: made, refused, worked through, and worked through again only where a file changed."""

import re
from pathlib import Path

import pandas as pd
import pytest

import observer_rt as ort
from observer_rt.desk.project.project import Project
from observer_rt.desk.project.steps import do
from observer_rt.files.formats import write_recording


def made(folder: Path, step: str) -> list[str]:
    """What a step says that it did."""
    said: list[str] = []
    do(step, Project.read(folder), said.append)
    return said


def record(path: Path, worn: float = 0.0, seed: int = 1) -> None:
    effects = {"orifice_area": worn} if worn else None
    recording, _ = ort.simulate(
        rail_pressure_MPa=[60, 120], energizing_ms=[0.8, 1.6], injections=4, effects=effects, seed=seed
    )
    write_recording(path, recording)


def test_a_new_project_has_folders_and_says_what_is_missing(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    Project.new(folder, None)
    assert {path.name for path in folder.iterdir()} == {"project.toml", "injector.toml", "healthy", "recordings"}
    with pytest.raises(ort.UserError, match="is there already"):
        Project.new(folder, None)
    with pytest.raises(ort.UserError, match="matches no file"):
        made(folder, "evaluate")
    with pytest.raises(ort.UserError, match="observer-rt project new"):
        Project.read(tmp_path)


def test_a_mistake_in_the_file_is_named(tmp_path: Path) -> None:
    Project.new(tmp_path, None)
    path = tmp_path / "project.toml"
    path.write_text(path.read_text().replace("healthy =", "helthy ="))
    with pytest.raises(ort.UserError, match="did you mean 'healthy'"):
        Project.read(tmp_path)


def test_without_healthy_recordings_the_model_is_used_as_it_is(tmp_path: Path) -> None:
    Project.new(tmp_path, None)
    record(tmp_path / "recordings" / "a.parquet", worn=0.2)
    said = made(tmp_path, "evaluate")
    assert "no healthy recordings" in said[0]
    table = pd.read_csv(tmp_path / "results" / "injections.csv")
    assert table.valid.all()
    assert "up to date" in made(tmp_path, "evaluate")[-1]
    record(tmp_path / "recordings" / "b.parquet", worn=0.1, seed=2)
    assert "8 injections" in made(tmp_path, "evaluate")[-1]


@pytest.mark.slow
def test_report_does_all_and_again_only_what_changed(tmp_path: Path) -> None:
    Project.new(tmp_path, None)
    for seed in (1, 2):
        record(tmp_path / "healthy" / f"{seed}.parquet", seed=seed)
    record(tmp_path / "recordings" / "worn.parquet", worn=0.25, seed=3)
    said = made(tmp_path, "report")
    assert [line.split(":")[0] for line in said] == ["fit", "evaluate", "discover", "report"]
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "orifice_area" in page
    assert "What makes a mass uncertain" in page
    assert len(re.findall(r"<tr><td>worn.parquet</td>", page)) == 4  # each injection, from the first on
    assert (tmp_path / "results" / "discovery" / "amended.toml").exists()
    assert all("up to date" in line for line in made(tmp_path, "report")[:-1])
    record(tmp_path / "recordings" / "worn.parquet", worn=0.1, seed=4)
    said = made(tmp_path, "evaluate")
    assert "up to date" in said[0]
    assert "up to date" not in said[1]


def test_files_of_somebody_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "injector.toml").write_text("mine")
    with pytest.raises(ort.UserError, match=r"injector\.toml: is there already"):
        Project.new(tmp_path, None)
    assert [path.name for path in tmp_path.iterdir()] == ["injector.toml"]
