"""Takes an amended model over: the bench file names it from now on, and the daemon that serves the bench reads it.

What the bench file named before is noted beside it, so that each step can be undone.
"""

import json
import os
import shutil
import signal
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

import tomlkit

from observer_rt.config.bench import Bench, load_bench, load_injector
from observer_rt.daemon.evidence import OBSERVER
from observer_rt.daemon.persistence.keeper import writer_of
from observer_rt.daemon.persistence.state_file import learned_beside
from observer_rt.desk.beforehand import learn_beforehand
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing, write_text

HISTORY = ".taken_over.json"  # behind the name of the bench file


@dataclass(frozen=True)
class TakeOver:
    """One step: the file that the bench named before (None: none) and after, of which injector, and when.

    learned_from: kept events that were learned from beforehand, with the model after.
    """

    injector: str
    before: str | None
    after: str
    time: str
    learned_from: int = 0

    @property
    def as_text(self) -> str:
        """What the bench names now, and what is known with it."""
        learned = (
            f", with what {self.learned_from} events of the evidence taught it" if self.learned_from else ""
        )
        return f"{self.after}{learned}"


def take_over(bench: Bench, amended: Path) -> TakeOver:
    """Learn for an amended injector file, and have the bench file name a copy of it, beside the one it named.

    bench: with one injector. Raises `UserError` for a model that cannot be loaded, or is the one in force.
    """
    injector = bench.injector
    if load_injector(amended) == injector.parameters:
        raise UserError(str(amended), "is the model in force already", "name another one")
    before = steps(bench.path)
    beside = bench.path.parent
    if injector.config.model.file is not None:
        beside = injector.parameters_path.parent
    stem = injector.parameters_path.stem.partition("_amended_")[0]
    names = (beside / f"{stem}_amended_{number}.toml" for number in count(len(before) + 1))
    copy = next(name for name in names if not (name.exists() or learned_beside(name).exists()))
    with file_errors(copy), replacing(copy) as part:
        shutil.copyfile(amended, part)
    after = os.path.relpath(copy, bench.path.parent)
    time = datetime.now().isoformat(timespec="seconds")
    done = TakeOver(injector.name, injector.config.model.file, after, time, learn_beforehand(bench, copy))
    _state(bench.path, injector.name, after)
    _note(bench.path, [*before, done])
    return done


def undo(path: Path, injector: str = "") -> TakeOver:
    """Have the bench file name what it named before the last step of an injector. Raises `UserError` without one."""
    done = steps(path)
    own = [step for step in done if step.injector == injector]
    if not own:
        raise UserError(f"{path}", "no model was taken over", "name the injector file by hand: [model] file")
    last = own[-1]
    _state(path, injector, last.before)
    _note(path, [step for step in done if step is not last])
    return last


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


def reload_daemon(bench: Bench) -> int | None:
    """Have the daemon that keeps the injector's evidence read the bench file; its process id, None: none runs."""
    folder = bench.injector.evidence
    process = None if folder is None else writer_of(folder / OBSERVER)
    if process is not None:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGUSR1)
            return process
    return None


def _state(path: Path, injector: str, file: str | None) -> None:
    """Name an injector file in a bench file, None: that of the package; all else stays to the letter."""
    with file_errors(path):
        document: Any = tomlkit.parse(path.read_text(encoding="utf-8"))
        section = document["injectors"][injector] if injector else document
        if file is not None:
            section.setdefault("model", tomlkit.table())["file"] = file
        elif "model" in section:
            section["model"].pop("file", None)
        with replacing(path) as part:
            part.write_text(tomlkit.dumps(document), encoding="utf-8")
            load_bench(part, off_bus=True)


def _note(path: Path, done: list[TakeOver]) -> None:
    history = path.with_name(path.name + HISTORY)
    if not done:
        with file_errors(history):
            history.unlink(missing_ok=True)
        return
    write_text(history, json.dumps([asdict(step) for step in done], indent=2) + "\n")
