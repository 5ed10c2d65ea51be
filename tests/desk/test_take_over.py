"""Taking an amended model over: the bench file names it and keeps all else, and each step can be undone."""

import fcntl
import shutil
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, load_bench
from observer_rt.daemon.control_socket import Message, control_socket
from observer_rt.desk.take_over import steps, take_over, undo
from observer_rt.foundation.errors import ObserverError, RunError, UserError
from tests.desk.cli.injector_files import worn_file

FIRST = "crin3_nominal_amended_1.toml"


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    shutil.copyfile(EXAMPLE_BENCH, path)
    return path


@pytest.fixture
def kept(bench: Path) -> Path:
    """What a daemon of the bench locks, whose file names a folder of evidence."""
    bench.write_text(bench.read_text().replace('# folder = "evidence"', 'folder = "evidence"'))
    folder = bench.with_name("evidence")
    folder.mkdir()
    return folder / "observer"


@contextmanager
def locked(kept: Path, process: int) -> Iterator[None]:
    """As while a daemon lives that calls itself by this number, be it in another container."""
    with kept.with_name(kept.name + ".lock").open("w") as lock:
        lock.write(str(process))
        lock.flush()
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def amended(folder: Path, v_h: float) -> Path:
    return worn_file(folder / f"worn_{v_h}.toml", v_h)


def worn(bench: Path, injector: str | None = None) -> float:
    effects = load_bench(bench).of(injector).injector.parameters.effects
    return effects[0].parameters["v_H"].value if effects else 0.0


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_each_step_is_undone_in_turn_to_the_letter(bench: Path, tmp_path: Path) -> None:
    texts = [bench.read_text()]
    for v_h in (0.1, 0.2):
        done = take_over(bench, "", amended(tmp_path, v_h), accepts_changes=True)
        assert done.answer is None
        assert worn(bench) == v_h
        texts.append(bench.read_text())
    assert [step.after for step in steps(bench)] == [FIRST, "crin3_nominal_amended_2.toml"]
    amended(tmp_path, 0.2).unlink()  # what was taken over is a copy
    assert worn(bench) == 0.2
    undo(bench)
    assert (worn(bench), bench.read_text()) == (0.1, texts[1])
    undo(bench)
    assert worn(bench) == 0.0
    assert [row for row in bench.read_text().splitlines() if row] == [row for row in texts[0].splitlines() if row]
    with pytest.raises(UserError, match="no model was taken over"):
        undo(bench)


def test_what_was_named_by_hand_is_not_undone(bench: Path, tmp_path: Path) -> None:
    take_over(bench, "", amended(tmp_path, 0.1))
    bench.write_text(bench.read_text().replace(FIRST, amended(tmp_path, 0.3).name))
    with pytest.raises(UserError, match=r"worn_0\.3\.toml, and no model was taken over"):
        undo(bench)
    assert worn(bench) == 0.3


@pytest.mark.parametrize("name", [FIRST, "crin3_nominal_amended_1.learned.json"])
def test_a_file_of_somebody_else_is_left_alone(bench: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("by hand")
    done = take_over(bench, "", amended(tmp_path, 0.1))
    assert (done.step.after, (tmp_path / name).read_text()) == ("crin3_nominal_amended_2.toml", "by hand")


def test_benches_in_one_folder_have_models_of_their_own(bench: Path, tmp_path: Path) -> None:
    other = shutil.copyfile(bench, tmp_path / "other.toml")
    take_over(bench, "", amended(tmp_path, 0.1))
    take_over(other, "", amended(tmp_path, 0.2))
    assert (worn(bench), worn(other)) == (0.1, 0.2)


def test_an_injector_keeps_its_model_whatever_becomes_of_the_others(bench: Path, tmp_path: Path) -> None:
    bench.write_text(bench.read_text() + "\n[injectors.left]\n[injectors.right.outputs]\ninjector_id = 9\n")
    take_over(bench, "left", amended(tmp_path, 0.1))
    assert (worn(bench, "left"), worn(bench, "right")) == (0.1, 0.0)
    take_over(bench, "right", amended(tmp_path, 0.2))
    undo(bench, "left")
    take_over(bench, "left", amended(tmp_path, 0.3))
    assert (worn(bench, "left"), worn(bench, "right")) == (0.3, 0.2)
    assert {step.after for step in steps(bench)} == {"right_amended_1.toml", "left_amended_2.toml"}


def test_a_model_that_cannot_be_served_leaves_all_files_as_they_are(bench: Path, tmp_path: Path) -> None:
    broken = amended(tmp_path, 0.1)
    broken.write_text(broken.read_text().replace("orifice_area", "orifice_aera"))
    before = files(tmp_path)
    with pytest.raises(UserError, match="orifice_aera"):
        take_over(bench, "", broken)
    with pytest.raises(UserError, match="in force already"):
        take_over(bench, "", NOMINAL_INJECTOR)
    assert files(tmp_path) == before


def test_corrections_made_meanwhile_are_lost_only_where_that_is_accepted(bench: Path, tmp_path: Path) -> None:
    present = tmp_path / "injector.toml"
    present.write_text(NOMINAL_INJECTOR.read_text().replace("length = 0.15 ", "length = 0.16 "))
    bench.write_text(bench.read_text().replace('# file = "injector.toml"', 'file = "injector.toml"'))
    result = amended(tmp_path, 0.1)
    before = files(tmp_path)
    with pytest.raises(UserError, match=r"line\.length 0\.16 m -> 0\.15 m"):
        take_over(bench, "", result)
    assert files(tmp_path) == before
    assert take_over(bench, "", result, accepts_changes=True).changes == ("line.length 0.16 m -> 0.15 m",)
    assert undo(bench).changes == ("line.length 0.15 m -> 0.16 m",)


def test_a_process_whose_number_a_lock_holds_is_never_signalled(bench: Path, kept: Path, tmp_path: Path) -> None:
    result = amended(tmp_path, 0.1)
    before = files(tmp_path)
    with subprocess.Popen(["sleep", "60"]) as foreign:
        try:
            with locked(kept, foreign.pid), pytest.raises(RunError, match="takes no requests"):
                take_over(bench, "", result)
            assert foreign.poll() is None
        finally:
            foreign.kill()
    assert files(tmp_path) == before


def test_a_stale_lock_is_of_no_daemon(bench: Path, kept: Path, tmp_path: Path) -> None:
    kept.with_name("observer.lock").write_text("1")
    kept.with_name("observer.socket").touch()
    assert take_over(bench, "", amended(tmp_path, 0.1)).answer is None


def refused(_: Message) -> Message:
    raise UserError("bench.toml", "is not liked", "change it")


@pytest.mark.parametrize(
    ("answer", "kind", "words"),
    [
        (refused, UserError, "is not liked"),
        (lambda _: {"model": "another", "bench": "/bench.toml"}, RunError, "has another model in force"),
    ],
)
def test_a_daemon_that_does_not_take_it_leaves_all_files_as_they_were(
    bench: Path, kept: Path, tmp_path: Path, answer: object, kind: type[ObserverError], words: str
) -> None:
    take_over(bench, "", amended(tmp_path, 0.1))
    result = amended(tmp_path, 0.2)
    before = files(tmp_path)
    with control_socket(kept, {"reload": answer}):  # type: ignore[dict-item]
        with pytest.raises(kind, match=words):
            take_over(bench, "", result, accepts_changes=True)
        with pytest.raises(kind, match=words):
            undo(bench)
    assert files(tmp_path) == before


def test_several_at_once_come_one_after_another(bench: Path, tmp_path: Path) -> None:
    sizes = (0.1, 0.2, 0.3, 0.4)
    result = [amended(tmp_path, v_h) for v_h in sizes]
    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(take_over, bench, "", each, True) for each in result]:
            done.result()
    undone = [worn(bench)]
    for _ in sizes[1:]:
        undo(bench)
        undone.append(worn(bench))
    assert sorted(undone) == list(sizes)


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_ends_of_lines_comments_links_and_rights_stay(bench: Path, tmp_path: Path, mark: bytes) -> None:
    text = bench.read_bytes().replace(b"\n", b"\r\n")
    text = mark + text.replace(b'# file = "injector.toml"', b'file = "injector.toml"  # by drawing 7')
    shutil.copyfile(NOMINAL_INJECTOR, tmp_path / "injector.toml")
    real = tmp_path / "elsewhere" / "cell1.toml"
    real.parent.mkdir()
    real.write_bytes(text)
    real.chmod(0o664)
    bench.unlink()
    bench.symlink_to(real)
    take_over(bench, "", amended(tmp_path, 0.1))
    assert real.read_bytes() == text.replace(b'"injector.toml"', b'"injector_amended_1.toml"', 1)
    assert bench.is_symlink()
    assert real.stat().st_mode & 0o777 == 0o664
    undo(bench)
    assert real.read_bytes() == text
