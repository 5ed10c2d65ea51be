"""The campaign of kills: a few of them, and that it would see what it looks for."""

import random
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.daemon.event_logger import line
from observer_rt.daemon.persistence.journal import JournalWriter
from observer_rt.daemon.persistence.state_file import model_hash, save_knowledge
from tests.daemon.samples import some_knowledge, some_report
from tools.benchmarks.kills.campaign import (
    Kept,
    Line,
    Plan,
    Strike,
    differences,
    injections_of,
    kills_document,
    loss,
    read_back,
    run_campaign,
)
from tools.benchmarks.kills.victim import Scene

COUNT = 5
NOTHING = Kept(0, {})
REPORTS = [some_report(number, mass=(41.5 + 0.01 * number) * 1e-6) for number in range(1, COUNT + 1)]
TOLD = [line(report) for report in REPORTS]


@pytest.mark.slow
def test_a_few_kills_lose_nothing_older_than_stated(tmp_path: Path) -> None:
    plan = Plan(8, 7, tmp_path, 1.0, "virtual", "kills-test", longest=2.0)
    kills = list(run_campaign(plan))
    assert [problem for kill in kills for problem in kill.problems] == []
    assert {kill.strike for kill in kills} == set(Strike)
    assert all(kill.told > 0 for kill in kills if kill.strike is not Strike.MOMENT)
    assert sum(kill.warnings for kill in kills) > 0  # of full disks
    assert len(kills_document(kills, plan)["kills"]) == 8


@pytest.mark.slow
@pytest.mark.vcan
def test_the_same_on_a_real_interface(tmp_path: Path, vcan: str) -> None:
    kills = list(run_campaign(Plan(4, 9, tmp_path, 1.0, "socketcan", vcan)))
    assert [problem for kill in kills for problem in kill.problems] == []
    assert sum(kill.told for kill in kills) > 0


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """Files as a daemon leaves them that has learned from, and told of, `COUNT` injections."""
    bench = load_bench()
    scene = Scene(bench, (), tmp_path / "state.json", tmp_path / "injections.sqlite")
    save_knowledge(scene.state, some_knowledge(events=COUNT), model_hash(bench.injector.parameters))
    journal = JournalWriter(scene.journal, bench, print)
    for report in REPORTS:
        journal(report)
    journal.finish()
    return scene


def told(*changed: str) -> list[Line]:
    """The lines, a second apart from 0 s on; the last ones changed."""
    texts = [*TOLD[: len(TOLD) - len(changed)], *changed]
    return [Line(float(at), f"2026-01-31 12:00:00 {text}") for at, text in enumerate(texts)]


def test_whole_files_that_say_the_same_have_no_problem(scene: Scene) -> None:
    kept, problems = read_back(scene)
    assert problems == []
    assert kept is not None
    assert kept.events == COUNT
    assert differences(NOTHING, kept, injections_of(told())) == []
    lost = loss(NOTHING, kept, injections_of(told()), killed=10.0)
    assert (lost.state, lost.journal) == (0.0, 0.0)


def test_what_is_missing_at_the_end_has_an_age(scene: Scene) -> None:
    kept, _ = read_back(scene)
    assert kept is not None
    more = injections_of([*told(), Line(6.5, TOLD[0]), Line(7.5, TOLD[0])])
    lost = loss(NOTHING, Kept(COUNT - 1, kept.runs), more, killed=10.0)
    assert (lost.state, lost.journal) == (6.0, 3.5)


def test_a_row_that_is_not_what_was_said_is_seen(scene: Scene) -> None:
    kept, _ = read_back(scene)
    assert kept is not None
    other = TOLD[-1].replace("correction 5", "correction 6")
    (problem,) = differences(NOTHING, kept, injections_of(told(other)))
    assert problem.startswith("said injection 5")


@pytest.mark.parametrize(
    ("change", "seen"),
    [
        ("DELETE FROM injection WHERE number = 2", "rows missing in the midst"),
        ("UPDATE injection SET mass_mg = 0 WHERE number = 2", "said injection 2"),
    ],
)
def test_a_changed_row_is_seen(scene: Scene, change: str, seen: str) -> None:
    before, _ = read_back(scene)
    with closing(sqlite3.connect(scene.journal)) as connection:
        connection.execute(change)
        connection.commit()
    after, problems = read_back(scene)
    assert problems == []
    assert before is not None
    assert after is not None
    assert any(seen in problem for problem in differences(NOTHING, after, injections_of(told())))
    assert any("earlier run changed" in problem for problem in differences(before, after, []))


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _scribble(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-4096:] = random.Random(1).randbytes(4096)
    path.write_bytes(content)


@pytest.mark.parametrize(("name", "damage"), [("state.json", _cut), ("injections.sqlite", _scribble)])
def test_damage_is_seen(scene: Scene, name: str, damage: Callable[[Path], None]) -> None:
    damage(scene.state.with_name(name))
    kept, problems = read_back(scene)
    assert kept is None
    assert len(problems) == 1
    assert name in problems[0]
