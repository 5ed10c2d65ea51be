"""Takes an amended model over: the bench file names it from now on, and the daemon that serves the bench uses it.

First it learns for that model from the events that were kept with the one in force, so that the first injection is
estimated as well as the last one before. Then either both happen or neither: a daemon that cannot be asked, or does
not end up with this model, leaves the bench file as it was. What the file named before is noted beside it, so that
each step can be undone, one at a time.
"""

import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench, BenchInjector, load_bench, load_injector
from observer_rt.config.signals import as_observed
from observer_rt.daemon.control_socket import Message, ask, socket_places
from observer_rt.daemon.reloading import RELOAD
from observer_rt.daemon.state_file import learned_beside, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.model_steps import TakeOver, naming, note_steps, replace_text, steps
from observer_rt.desk.other_changes import other_changes, parameter_changes
from observer_rt.files.evidence import KeptEvent
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import to_disk
from observer_rt.identification.likelihood.kept_events import read_folder

MOST = 100  # kept events that are learned from, the newest; a hundredth of a second each
_AMENDED = "_amended_"  # in the name of a copy, before its number


@dataclass(frozen=True)
class StepOutcome:
    """A step that was taken, or undone: what it changed besides, and what a daemon says that has it in force.

    answer: None: there is no daemon; its `unsaved` is a problem of what was learned before, if that was not saved.
    """

    step: TakeOver
    changes: tuple[str, ...]
    answer: Message | None


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
        answer = _in_force(path, injector, last.before, remaining)
        after = load_bench(path).of(injector or None).injector.parameters
        return StepOutcome(last, parameter_changes(fitted.parameters, after), answer)


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


def _in_force(path: Path, injector: str, file: str | None, done: Sequence[TakeOver]) -> Message | None:
    """Have the bench file name an injector file, and a daemon read it; its answer, if there is one. All or nothing.

    done: the history then. It is written first, for a step that never came to be is passed over.
    """
    before, history = path.read_bytes(), steps(path)
    after = naming(path, before, injector, file)
    try:
        note_steps(path, done)
        replace_text(path, after)
        return _reload(load_bench(path).of(injector or None))
    except BaseException:
        if path.read_bytes() == after:  # by nobody else meanwhile
            replace_text(path, before)
        note_steps(path, history)
        raise


def _reload(bench: Bench) -> Message | None:
    """Have the daemon that keeps the injector's evidence or state read the bench file; None: no daemon does.

    Raises `UserError` or `RunError` unless it has the model of the bench in force then.
    """
    fitted = bench.injector
    model = model_hash(fitted.parameters)
    for kept in socket_places(fitted):
        answer = ask(kept, {"request": RELOAD, "model": model})
        if answer is not None:
            if answer.get("model") != model:
                raise RunError(f"the daemon of {answer.get('bench')} has another model in force: see its log")
            return answer
    return None


def learn_beforehand(bench: Bench, amended: Path) -> int:
    """Learn for an amended injector file from the evidence; from how many events, 0: there is nothing to begin with.

    bench: with one injector, and the model before in force. What was learned is written beside the amended file,
    where a daemon looks for it; nothing is where the amended model does not explain the last of the events.
    """
    state_file = learned_beside(amended)
    with file_errors(state_file):
        state_file.unlink(missing_ok=True)
    parameters, learning = load_injector(amended), bench.injector.config.learning.enabled
    mended = bench.with_sections(signals=as_observed(bench.injector.config.signals))
    try:
        events = [HeldSignals(event.recording) for event in _kept_with(bench.injector)]
        if not events:
            return 0
        history = evaluate(mended.with_parameters(parameters), events, learning=learning, traces=())
    except UserError:  # no evidence, or of another sample rate
        return 0
    judged = [report for each in history.evaluations for report in each.reports]
    knowledge = history.knowledge
    if not (knowledge.state.events and judged[-1].valid):
        return 0
    save_knowledge(state_file, knowledge, parameters)
    return knowledge.state.events


def _kept_with(fitted: BenchInjector) -> Sequence[KeptEvent]:
    """Events that were kept with this model, the oldest first. Raises `UserError` for a folder without any.

    None where the bench measures the fuel's temperature, which evidence does not hold.
    """
    if fitted.evidence is None or fitted.config.signals.fuel_temperature is not None:
        return ()
    model = model_hash(fitted.parameters)
    kept = read_folder(fitted.evidence, Console(quiet=True))
    return [one for one in kept if one.belief["model_sha256"] == model][-MOST:]
