"""`observer-rt take-over` beside a daemon in a container of its own, which shares the bench's folder only."""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.daemon.end_to_end import START_TIMEOUT
from tests.daemon.end_to_end import command as words
from tests.daemon.participants import until
from tests.desk.cli.conftest import Command
from tests.desk.cli.injector_files import worn_file


@pytest.fixture
def bench(bench: Path, tmp_path: Path) -> Path:
    """With evidence, on a channel of the test's own."""
    text = bench.read_text().replace('# folder = "evidence"', 'folder = "evidence"')
    bench.write_text(text.replace('"can0"', f'"{tmp_path.name}"'))
    return bench


def of_its_own() -> Sequence[str]:
    """A command's beginning that gives it process numbers of its own, if this user may."""
    prefix = ["unshare", "--pid", "--fork", "--kill-child"]
    return prefix if subprocess.run([*prefix, "true"], check=False, capture_output=True).returncode == 0 else ()


def test_a_daemon_in_a_container_has_it_in_force_in_the_end(command: Command, bench: Path, tmp_path: Path) -> None:
    log, name = tmp_path / "run.log", "crin3_nominal_amended_1.toml"
    with subprocess.Popen([*of_its_own(), *words("run", "--bench", bench, "--log", log)]) as daemon:
        try:
            until(lambda: log.exists() and "start: ready" in log.read_text(), START_TIMEOUT)
            outcome = command.done("take-over", worn_file(tmp_path / "worn.toml", 0.1), "--bench", bench)
            assert name in outcome.out
            assert "the daemon has it in force" in outcome.err
            until(lambda: "orifice_area v_H = 0.1" in log.read_text(), START_TIMEOUT)
            before = bench.read_text()
            bench.write_text(before.replace("bridge_ms = 0.5", "bridge_ms = 50"))
            assert command("take-over", "--undo", "--bench", bench).code == 2
            bench.write_text(before)
            command.done("take-over", "--undo", "--bench", bench)
            assert daemon.poll() is None
        finally:
            daemon.kill()  # which unshare hands on
    assert name not in bench.read_text()


def test_changes_besides_need_a_word(command: Command, bench: Path, tmp_path: Path) -> None:
    result = worn_file(tmp_path / "worn.toml")
    result.write_text(result.read_text().replace("length = 0.15 ", "length = 0.16 ", 1))
    refusal = command.refused("take-over", result, "--bench", bench)
    assert "line.length 0.15 m -> 0.16 m" in refusal
    assert "--accept-changes" in refusal
    outcome = command.done("take-over", result, "--bench", bench, "--accept-changes")
    assert "line.length 0.15 m -> 0.16 m" in outcome.out
    assert "no daemon is found" in outcome.err
