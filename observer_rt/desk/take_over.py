"""Takes an amended model over: the bench file names it from now on, and the daemon that serves the bench uses it.

First it learns for that model from kept events, so that the first injection is estimated as well as the last one.
Then both happen or neither: a daemon that does not end up with this model leaves the bench file as it was. Each step
is noted beside it, and can be undone. A finding adds effects and terms; taking it over would undo other corrections.
"""

import fcntl
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from pydantic import BaseModel
from rich.console import Console
from tomlkit.exceptions import TOMLKitError

from observer_rt.config.bench import Bench, BenchInjector, load_bench, load_injector
from observer_rt.config.signals import as_observed
from observer_rt.daemon.control_socket import Message, ask, socket_places
from observer_rt.daemon.reloading import RELOAD
from observer_rt.daemon.state_file import learned_beside, model_hash, save_knowledge
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.evidence_folder import KeptEvent
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.errors import RunError, UserError, file_errors
from observer_rt.foundation.files import replacing, to_disk, write_text
from observer_rt.identification.likelihood.kept_events import read_folder
from observer_rt.model.parameters import EffectInForce, InjectorParameters, UnitName
from observer_rt.model.terms.in_force import TermInForce

MOST = 100  # kept events that are learned from, the newest; a hundredth of a second each
_AMENDED = "_amended_"  # in the name of a copy, before its number
HISTORY = ".taken_over.json"  # behind the name of the bench file
_MARK = "\ufeff"  # at the beginning of files by some editors
_FINDING_KEYS = frozenset({"effects", "terms", "remainder"})
_FIT_KEY = "baseline"


@dataclass(frozen=True)
class TakeOver:
    """One change of the model in force."""

    injector: str
    before: str | None  # injector file that the bench named; None: none
    after: str  # the one that it names since
    time: str
    learned_from: int = 0  # kept events from which the new model learned before it was put into force

    @property
    def as_text(self) -> str:
        """The file that the bench names now, and the origin of its learned state."""
        learned = f", with what {self.learned_from} events of the evidence taught it" if self.learned_from else ""
        return f"{self.after}{learned}"


class StepOutcome(NamedTuple):
    """A step that was taken or undone."""

    step: TakeOver
    changes: tuple[str, ...]  # of parameters, besides the effects and terms added
    answer: Message | None  # of the daemon, None without one; `unsaved`: why earlier knowledge was not saved


def take_over(path: Path, injector: str, amended: Path, accepts_changes: bool = False) -> StepOutcome:
    """Learn for an amended injector file, and have a bench file name a copy of it, beside the file it named.

    injector: empty where the bench has one; accepts_changes: also those besides added effects and terms, else
    `UserError`, as for an unusable model or the one in force; `RunError`, too, for a daemon that does not take it.
    """
    with _locked_folder(path):
        bench = load_bench(path).of(injector or None)
        bench_injector, model = bench.injector, load_injector(amended)
        before = bench_injector.parameters
        if model == before:
            raise UserError(str(amended), "is the model in force already", "name another one")
        changes = (*parameter_changes(before, model), *_lost_entries(before, model))
        if changes and not accepts_changes:
            raise UserError(
                str(amended),
                f"would also change what {bench_injector.parameters_path.name} states: {'; '.join(changes)}",
                "were these corrected since the evidence was kept? search again with newer evidence, or accept them "
                "by --accept-changes",
            )
        done = steps(path)
        copy = _copy_amended(bench, amended, {Path(step.after).name for step in done})
        try:
            time, file = datetime.now().isoformat(timespec="seconds"), bench_injector.config.model.file
            after = os.path.relpath(copy, path.parent)
            step = TakeOver(injector, file, after, time, learn_beforehand(bench, copy))
            return StepOutcome(step, changes, _put_into_force(path, injector, after, [*done, step]))
        except BaseException:
            copy.unlink(missing_ok=True)
            learned_beside(copy).unlink(missing_ok=True)
            raise


def undo(path: Path, injector: str = "") -> StepOutcome:
    """Undo the last step of an injector. Raises `UserError` without one, otherwise as `take_over`."""
    with _locked_folder(path):
        bench_injector, done = load_bench(path).of(injector or None).injector, steps(path)
        own = [step for step in done if step.injector == injector]
        while own and own[-1].after != bench_injector.config.model.file:  # Interrupted, or undone by hand.
            own.pop()
        if not own:
            problem = f"names {bench_injector.parameters_path.name}, and no model was taken over to get there"
            raise UserError(f"{path}", problem, "name the injector file by hand: [model] file")
        last = own.pop()
        remaining = [step for step in done if step.injector != injector or step in own]
        answer = _put_into_force(path, injector, last.before, remaining)
        after = load_bench(path).of(injector or None).injector.parameters
        return StepOutcome(last, tuple(parameter_changes(bench_injector.parameters, after)), answer)


@contextmanager
def _locked_folder(path: Path) -> Iterator[None]:
    """Keep other processes from taking a model over for a bench file of the same folder."""
    with file_errors(path.parent):
        folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # a network's file system without such locks
            fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _copy_amended(bench: Bench, amended: Path, used: set[str]) -> Path:
    """It is named after the injector, by a number that no file has or had."""
    injector = bench.injector
    folder = injector.parameters_path.parent if injector.config.model.file is not None else bench.path.parent
    stem = injector.name or injector.parameters_path.stem.partition(_AMENDED)[0]
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


def _put_into_force(path: Path, injector: str, file: str | None, done: Sequence[TakeOver]) -> Message | None:
    """Have the bench file name an injector file, and a running daemon read it, or neither; returns its answer.

    done: the history afterwards. It is written first, for `undo` passes over an interrupted step.
    """
    before, history = path.read_bytes(), steps(path)
    after = naming_injector_file(path, before, injector, file)
    try:
        write_steps(path, done)
        replace_text(path, after)
        return _reload(load_bench(path).of(injector or None))
    except BaseException:
        if path.read_bytes() == after:  # by nobody else meanwhile
            replace_text(path, before)
        write_steps(path, history)
        raise


def _reload(bench: Bench) -> Message | None:
    """Have the daemon read the bench file; None without one. Raises an error unless it has the bench's model then."""
    injector = bench.injector
    model = model_hash(injector.parameters)
    for kept in socket_places(injector):
        answer = ask(kept, {"request": RELOAD, "model": model})
        if answer is not None:
            if answer.get("model") != model:
                raise RunError(f"the daemon of {answer.get('bench')} has another model in force: see its log")
            return answer
    return None


def learn_beforehand(bench: Bench, amended: Path) -> int:
    """Learn for an amended injector file from the evidence; returns the number of events learned from.

    bench: of one injector, with the earlier model. The knowledge is written beside the amended file, where a daemon
    looks. 0, and no file: without evidence, or if the amended model does not explain the last event.
    """
    state_file = learned_beside(amended)
    with file_errors(state_file):
        state_file.unlink(missing_ok=True)
    parameters, learning = load_injector(amended), bench.injector.config.learning.enabled
    mended = bench.with_sections(signals=as_observed(bench.injector.config.signals))
    try:
        events = [HeldSignals(event.recording) for event in _kept_events(bench.injector)]
        if not events:
            return 0
        history = evaluate(mended.with_parameters(parameters), events, learning=learning, traces=())
    except UserError:  # no evidence, or of another sample rate
        return 0
    judged = [report for evaluation in history.evaluations for report in evaluation.injections]
    knowledge = history.knowledge
    if not (knowledge.state.events and judged[-1].valid):
        return 0
    save_knowledge(state_file, knowledge, parameters)
    return knowledge.state.events


def _kept_events(injector: BenchInjector) -> Sequence[KeptEvent]:
    """Events kept with this model, the oldest first; none for measured surroundings, which evidence does not hold."""
    if injector.evidence is None or injector.config.signals.surroundings:
        return ()
    model = model_hash(injector.parameters)
    kept = read_folder(injector.evidence, Console(quiet=True))
    return [event for event in kept if event.belief["model_sha256"] == model][-MOST:]


def naming_injector_file(path: Path, content: bytes, injector: str, file: str | None) -> bytes:
    """A bench file's content with this injector file, None: the package's. Raises `UserError` if unchangeable."""
    text = content.decode("utf-8")
    mark, text = (_MARK, text[1:]) if text.startswith(_MARK) else ("", text)
    try:
        document: Any = tomlkit.parse(text)
    except TOMLKitError as error:
        problem = f"cannot be changed as text: {error}"
        raise UserError(str(path), problem, "name the file by hand: [model] file") from None
    section = document["injectors"][injector] if injector else document
    if file is not None:
        section.setdefault("model", tomlkit.table())["file"] = file
    elif "model" in section:
        section["model"].pop("file", None)
    changed = tomlkit.dumps(document)
    if "\r\n" in text and not re.search(r"(?<!\r)\n", text):  # the added lines get the file's line ends
        changed = re.sub(r"(?<!\r)\n", "\r\n", changed)
    return (mark + changed).encode("utf-8")


def replace_text(path: Path, content: bytes) -> None:
    """Replace a bench file in one step; its rights and owner stay."""
    owner = path.stat()
    with file_errors(path), replacing(path) as part:
        part.write_bytes(content)
        with suppress(PermissionError):
            os.chown(part, owner.st_uid, owner.st_gid)


def steps(path: Path) -> list[TakeOver]:
    """Steps that were not undone, the oldest first."""
    history = path.with_name(path.name + HISTORY)
    if not history.exists():
        return []
    with file_errors(history):
        try:
            return [TakeOver(**step) for step in json.loads(history.read_text(encoding="utf-8"))]
        except (ValueError, TypeError):
            raise UserError(str(history), "is no history of models taken over", "move it away") from None


def write_steps(path: Path, done: Sequence[TakeOver]) -> None:
    """Note the steps that were taken."""
    history = path.with_name(path.name + HISTORY)
    if not done:
        with file_errors(history):
            history.unlink(missing_ok=True)
        return
    write_text(history, json.dumps([asdict(step) for step in done], indent=2) + "\n")


def parameter_changes(before: BaseModel, after: BaseModel, prefix: str = "") -> Iterator[str]:
    """Parameters that differ, such as `line.length 0.16 m -> 0.15 m`. prefix: section of both, with a dot."""
    for key, field in type(before).model_fields.items():
        old, new = getattr(before, key), getattr(after, key)
        if old == new or key in _FINDING_KEYS:
            continue
        if key == _FIT_KEY:
            yield f"{key}: that of another fit"
        elif isinstance(old, BaseModel):
            yield from parameter_changes(old, new, f"{prefix}{key}.")
        else:
            unit = next((mark for mark in field.metadata if isinstance(mark, UnitName)), "")
            yield f"{prefix}{key} {_shown(old, unit)} -> {_shown(new, unit)}"


def _shown(value: object, unit: str) -> str:
    if value is None:
        return "(left out)"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.12g} {unit}".rstrip()


def _lost_entries(before: InjectorParameters, after: InjectorParameters) -> Iterator[str]:
    stated: list[EffectInForce | TermInForce] = [*before.effects, *before.terms]
    kept: list[EffectInForce | TermInForce] = [*after.effects, *after.terms]
    for entry in stated:
        if _physics_of(entry) not in map(_physics_of, kept):
            yield f"{entry.words} is left out, or stated otherwise"


def _physics_of(entry: EffectInForce | TermInForce) -> tuple[object, ...]:
    if isinstance(entry, TermInForce):
        size = entry.coefficient
        return entry.equation, entry.law, size and (size.value, size.unit)
    return entry.id, {name: (size.value, size.unit) for name, size in entry.parameters.items()}
