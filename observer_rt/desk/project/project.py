"""The folder of a project: `project.toml`, the files it names, and what was made of them as they are now."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from observer_rt import __version__
from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.toml_file import Section, place_in, read_toml, validated
from observer_rt.files.signals.recording import TRUTH_SUFFIX
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors, file_hash
from observer_rt.foundation.outputs import make_folder, write_text

PROJECT, MODEL, RESULTS, DONE = "project.toml", "injector.toml", "results", "done.json"
Say = Callable[[str], None]
_NEW = """\
# The work on one injector: paths are from this folder, `*` stands for any name.
model = "{model}"          # injector file to begin with: geometry right, the rest within a factor of two
healthy = ["healthy/*"]          # recordings of the healthy injector: the model is fitted to them
recordings = ["recordings/*"]    # to be evaluated, and searched for what is missing
# bench = "bench.toml"           # [recording] and [signals], where recordings have a layout of their own
# masses = "masses.csv"          # measured masses, for the fit: recording,mass_mg[,injection][,sigma_mg]
"""


class ProjectConfig(Section):
    """Content of `project.toml`; paths are relative to its folder."""

    model: str
    healthy: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    bench: str | None = None
    masses: str | None = None


@dataclass(frozen=True)
class Project:
    """A project's folder and what its file says."""

    folder: Path
    config: ProjectConfig

    @classmethod
    def new(cls, folder: Path, model: Path | None) -> Self:
        """Make the folder of a project, with a copy of an injector file; None: the nominal injector.

        Raises `UserError` for a folder that has a project, or cannot be made, and for a model that does not load.
        """
        start = model or NOMINAL_INJECTOR
        load_injector(start)
        for path in (folder / PROJECT, folder / MODEL):
            if path.exists():
                raise UserError(str(path), "is there already", "name another folder")
        with file_errors(folder):
            for below in (folder, folder / "healthy", folder / "recordings"):
                below.mkdir(parents=True, exist_ok=True)
        write_text(folder / MODEL, start.read_text(encoding="utf-8"))
        write_text(folder / PROJECT, _NEW.format(model=MODEL))
        return cls.read(folder)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the project of a folder. Raises `UserError` for one without, and for mistakes in its file."""
        path = folder / PROJECT
        if not path.exists():
            raise UserError(
                str(path), "is not there", f"make a project by `observer-rt project new {folder}`, or name its folder"
            )
        return cls(folder, validated(ProjectConfig, read_toml(path), place_in(path), "project"))

    @property
    def model(self) -> Path:
        """The injector file to begin with."""
        return self.folder / self.config.model

    @property
    def bench(self) -> Path | None:
        """The bench file, where there is one."""
        return self.folder / self.config.bench if self.config.bench else None

    @property
    def masses(self) -> Path | None:
        """Measured masses, where there are any."""
        return self.folder / self.config.masses if self.config.masses else None

    @property
    def healthy(self) -> list[Path]:
        """Recordings of the healthy injector."""
        return self._files(self.config.healthy)

    @property
    def recordings(self) -> list[Path]:
        """Recordings to be evaluated. Raises `UserError` without any."""
        files = self._files(self.config.recordings)
        if not files:
            named = ", ".join(self.config.recordings) or "nothing"
            raise UserError(
                f"{self.folder / PROJECT}: recordings",
                f"{named} matches no file",
                "put recordings there, or name them",
            )
        return files

    @property
    def results(self) -> Path:
        """The folder of what was made, which is made; `done.json` marks it as the program's own.

        Raises `UserError` for one that is not.
        """
        folder = self.folder / RESULTS
        if not (folder / DONE).exists():
            make_folder("project", folder)
            if any(folder.iterdir()):
                raise UserError(str(folder), f"holds files, but no {DONE}", "move them away")
            write_text(folder / DONE, "{}")
        return folder

    def _files(self, patterns: Iterable[str]) -> list[Path]:
        files = {path for pattern in patterns for path in self.folder.glob(pattern) if path.is_file()}
        return sorted(path for path in files if not path.name.endswith(TRUTH_SUFFIX))

    def state_of(self, files: Iterable[Path | None]) -> str:
        """Digest of files as they are now, of this version of the program."""
        digest = hashlib.sha256(__version__.encode())
        for path in files:
            if path is not None:
                with file_errors(path):
                    digest.update(f"{os.path.relpath(path, self.folder)} {file_hash(path)}\n".encode())
        return digest.hexdigest()

    def once(self, step: str, files: Iterable[Path | None], made: Path, work: Callable[[], str], say: Say) -> Path:
        """Do a step, unless it was done with these files as they are now, and what it made is still there.

        made: of the step; work: does it, and says what came of it; say: takes what was done, a line each.
        """
        state = self.state_of(files)
        if made.exists() and self._done.get(step) == state:
            say(f"{step}: {made} is up to date")
            return made
        outcome = work()
        write_text(self.results / DONE, json.dumps({**self._done, step: state}, indent=2))
        say(f"{step}: {made}: {outcome}")
        return made

    @property
    def _done(self) -> dict[str, str]:
        path = self.results / DONE
        try:
            record = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        return record if isinstance(record, dict) else {}
