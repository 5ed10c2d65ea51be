"""Takes an amended model over: the bench file names it from now on, and the daemon that serves the bench uses it.

Either both happen or neither: a daemon that cannot be asked, or does not end up with this model, leaves the bench
file as it was. What the file named before is noted beside it, so that each step can be undone, one at a time.
"""

import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from observer_rt.config.bench import Bench, load_bench, load_injector
from observer_rt.daemon.control_socket import ask, socket_places
from observer_rt.daemon.persistence.state_file import learned_beside, model_hash
from observer_rt.daemon.reloading import RELOAD
from observer_rt.desk.beforehand import learn_beforehand
from observer_rt.desk.model_steps import TakeOver, naming, note_steps, replace_text, steps
from observer_rt.desk.other_changes import other_changes, parameter_changes
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import to_disk

_AMENDED = "_amended_"  # in the name of a copy, before its number


@dataclass(frozen=True)
class StepOutcome:
    """A step that was taken, or undone: what it changed besides, and whether a daemon has it in force."""

    step: TakeOver
    changes: tuple[str, ...]
    has_daemon: bool


def take_over(path: Path, injector: str, amended: Path, accepts_changes: bool = False) -> StepOutcome:
    """Learn for an amended injector file, and have a bench file name a copy of it, beside the file it named.

    injector: empty where the bench has one; accepts_changes: also those besides the effects and terms added. Raises
    `UserError` without that, for a model that cannot be loaded, or is the one in force, and `UserError` or `RunError`
    for a daemon that does not take it.
    """
    with _alone(path):
        bench = load_bench(path).of(injector or None)
        fitted, model = bench.injector, load_injector(amended)
        if model == fitted.parameters:
            raise UserError(str(amended), "is the model in force already", "name another one")
        changes = other_changes(fitted.parameters, model)
        if changes and not accepts_changes:
            raise UserError(
                str(amended),
                f"would also change what {fitted.parameters_path.name} states: {'; '.join(changes)}",
                "were these corrected since the evidence was kept? search again with newer evidence, or accept them "
                "by --accept-changes",
            )
        done = steps(path)
        copy = _copied(bench, amended, {Path(step.after).name for step in done})
        try:
            time, before = datetime.now().isoformat(timespec="seconds"), fitted.config.model.file
            after = os.path.relpath(copy, path.parent)
            step = TakeOver(injector, before, after, time, learn_beforehand(bench, copy))
            return StepOutcome(step, changes, _in_force(path, injector, after, [*done, step]))
        except BaseException:
            copy.unlink(missing_ok=True)
            learned_beside(copy).unlink(missing_ok=True)
            raise


def undo(path: Path, injector: str = "") -> StepOutcome:
    """Have a bench file name what it named before the last step of an injector.

    Raises `UserError` where the file it names was not taken over, otherwise as `take_over`.
    """
    with _alone(path):
        fitted, done = load_bench(path).of(injector or None).injector, steps(path)
        own = [step for step in done if step.injector == injector]
        # A step that was interrupted, or undone by hand.
        while own and own[-1].after != fitted.config.model.file:
            own.pop()
        if not own:
            problem = f"names {fitted.parameters_path.name}, and no model was taken over to get there"
            raise UserError(f"{path}", problem, "name the injector file by hand: [model] file")
        last = own.pop()
        remaining = [step for step in done if step.injector != injector or step in own]
        has_daemon = _in_force(path, injector, last.before, remaining)
        after = load_bench(path).of(injector or None).injector.parameters
        return StepOutcome(last, parameter_changes(fitted.parameters, after), has_daemon)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """While no other process takes a model over for a bench file of the same folder."""
    with file_errors(path.parent):
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # a network's file system without such locks
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _copied(bench: Bench, amended: Path, used: set[str]) -> Path:
    """A copy by a name that no file has or had, with that of the injector in it."""
    fitted = bench.injector
    folder = fitted.parameters_path.parent if fitted.config.model.file is not None else bench.path.parent
    stem = fitted.name or fitted.parameters_path.stem.partition(_AMENDED)[0]
    content, number = amended.read_bytes(), 0
    while True:
        number += 1
        copy = folder / f"{stem}{_AMENDED}{number}.toml"
        if copy.name in used or learned_beside(copy).exists():
            continue
        with file_errors(copy), suppress(FileExistsError), copy.open("xb") as file:
            try:
                file.write(content)
                file.flush()
                to_disk(copy)
            except OSError:
                copy.unlink()
                raise
            return copy


def _in_force(path: Path, injector: str, file: str | None, done: Sequence[TakeOver]) -> bool:
    """Have the bench file name an injector file, and a daemon read it; whether there is one. All or nothing.

    done: the history then. It is written first, for a step that never came to be is passed over.
    """
    before, history = path.read_bytes(), steps(path)
    after = naming(path, before, injector, file)
    try:
        note_steps(path, done)
        replace_text(path, after)
        return _is_reloaded(load_bench(path).of(injector or None))
    except BaseException:
        if path.read_bytes() == after:  # by nobody else meanwhile
            replace_text(path, before)
        note_steps(path, history)
        raise


def _is_reloaded(bench: Bench) -> bool:
    """Have the daemon that keeps the injector's evidence or state read the bench file; False: no daemon does.

    Raises `UserError` or `RunError` unless it has the model of the bench in force then.
    """
    fitted = bench.injector
    model = model_hash(fitted.parameters)
    for kept in socket_places(fitted):
        answer = ask(kept, {"request": RELOAD, "model": model})
        if answer is not None:
            if answer.get("model") != model:
                raise RunError(f"the daemon of {answer.get('bench')} has another model in force: see its log")
            return True
    return False
