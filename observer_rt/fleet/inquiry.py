"""Discovery over the recordings of one injector: what a worker does, knowing nothing of the others."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.config.channels import effects_on_one_raster
from observer_rt.discovery.answer import Question, answer, refuse_incomparable
from observer_rt.discovery.folder import AMENDED, fits_in, make_folder, write_answer
from observer_rt.evaluation.second_opinion import second_opinion
from observer_rt.evaluation.sources import open_source
from observer_rt.evidence.excerpts import MOST_SAMPLES
from observer_rt.evidence.measurement import Measurement
from observer_rt.evidence.reading import hashes, read_measured, refuse_rates_missing, refuse_sample_rates
from observer_rt.fleet.groups import Group
from observer_rt.fleet.job import NO_MEMORY, FailedFile
from observer_rt.fleet.vocabulary import OwnEffects
from observer_rt.foundation.errors import ObserverError, UserError

SAMPLES = 4 * MOST_SAMPLES
"""Of all recordings of an injector together: a search takes memory and time by samples."""


@dataclass(frozen=True)
class Inquiry:
    """What is the same for all groups.

    folder: where relative paths begin; out: of all answers; healthy: recordings the model is judged against; threads:
    of each search.
    """

    folder: Path
    out: Path
    healthy: tuple[Path, ...]
    effects: OwnEffects
    threads: int


@dataclass(frozen=True)
class Ended:
    """How it ended. left_out: recordings that could not be taken; problem: why there is no answer, else empty."""

    left_out: tuple[FailedFile, ...] = ()
    problem: str = ""


def discovered(inquiry: Inquiry, group: Group) -> Ended:
    """Write the answer on a group into its folder."""
    discovery = _Discovery(inquiry, group)
    problem = ""
    try:
        inquiry.effects.use()
        discovery.write()
    except ObserverError as error:
        problem = str(error)
    except MemoryError:
        problem = NO_MEMORY
    return Ended(tuple(discovery.left_out), problem)


class _Discovery:
    """left_out: recordings that could not be taken."""

    def __init__(self, inquiry: Inquiry, group: Group) -> None:
        self._inquiry = inquiry
        self._group = group
        injector = group.kind.alone.injector
        self._parameters = injector.parameters
        self._stated = effects_on_one_raster(injector)
        self._signals = injector.config.signals
        self.left_out: list[FailedFile] = []

    def write(self) -> None:
        begin = time.monotonic()
        inquiry, group = self._inquiry, self._group
        paths, measured = self._measured()
        healthy = self._read(inquiry.healthy)
        refuse_sample_rates([one.recording for one in (*measured, *healthy)])
        question = Question(self._parameters, measured, healthy, hashes(paths))
        refuse_incomparable(question, group.kind.file.name)
        folder = inquiry.out / group.folder
        make_folder(folder)
        ask = partial(second_opinion, signals=self._signals)
        with fits_in(folder, question, self._stated) as store:
            found = answer(question, store, ask, lambda _: None, AMENDED, inquiry.threads)
        found = replace(found, seconds=time.monotonic() - begin)
        write_answer(folder, question, found, group.kind.file, inquiry.healthy)

    def _measured(self) -> tuple[list[Path], tuple[Measurement, ...]]:
        """Recordings that can be judged with the latest one. Raises `UserError` where there is none."""
        paths: list[Path] = []
        measured: list[Measurement] = []
        for name, sha256 in self._group.files:
            path = self._inquiry.folder / name
            try:
                (one,) = self._read([path], SAMPLES // len(self._group.files))
                with_first = [each.recording for each in (*measured[:1], one)]
                refuse_sample_rates(with_first)
                refuse_rates_missing(with_first)
            except ObserverError as error:
                self.left_out.append(FailedFile(name, sha256, str(error), self._group.injector))
            else:
                paths.append(path)
                measured.append(one)
        if not measured:
            raise UserError(
                f"{len(self.left_out)} recordings",
                f"none can be taken, the latest because {self.left_out[0].problem}",
            )
        return paths, tuple(measured)

    def _read(self, paths: Sequence[Path], most: int = MOST_SAMPLES) -> tuple[Measurement, ...]:
        quiet = Console(quiet=True)
        read = partial(open_source, bench=self._group.kind.alone, from_channels=(), console=quiet)
        return read_measured(paths, read, quiet, min(most, MOST_SAMPLES), self._stated) if paths else ()
