"""An injector as the library has it: its model, fit, evaluation, and what a search finds missing in the model."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from html import escape
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import pandas as pd

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.config.effects import effects_named
from observer_rt.config.injector_file import InjectorFile
from observer_rt.config.signals import effects_on_one_raster
from observer_rt.desk.evaluation.healthy_events import learn_laws, observer_remainder
from observer_rt.desk.evaluation.histories import evaluate_runs, look_over, starting_knowledge
from observer_rt.desk.injection_map.map_document import write_map_fit
from observer_rt.desk.injection_map.map_fit import FEWEST_POINTS, fit_map
from observer_rt.desk.injection_map.mass_map import read_map
from observer_rt.desk.library.fit import FitResult, MapResult, fitted_model, weighed_masses
from observer_rt.desk.library.notes import CallNotes, naming_parameters, noted, screen
from observer_rt.desk.library.recordings import Recordings, digests, path_of, sources_of
from observer_rt.desk.library.results import EvaluationResult
from observer_rt.engine.service.injector import calibration_of
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.files import write_text
from observer_rt.foundation.outputs import IN_A_CALL, INJECTOR_FILE, check_output, make_folder
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.amend import AMENDED
from observer_rt.identification.discovery.discover import DiscoveryTask, answer, refuse_incomparable
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.folder import REPORT, check_answer_folder, write_findings
from observer_rt.identification.discovery.law_words import law_text
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.fit.fitted_file import write_fitted
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import coverage, measured_recordings
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import InjectorParameters

Pathlike = str | PathLike[str]
_FITTED = "fitted.toml"


@dataclass(frozen=True, repr=False)
class Injector:
    """Model of an injector, from an injector file, and the bench it is on. Never changes: `fit` gives another.

    Two injectors of the same files are equal. calibration, map_result: set by `fit`, by `fit_map`; else None.
    """

    bench: Bench
    file: InjectorFile
    calibration: FitResult | None = field(default=None, compare=False)
    map_result: MapResult | None = field(default=None, compare=False)

    @classmethod
    def load(cls, path: Pathlike | None = None, bench: Pathlike | None = None, injector: str | None = None) -> Self:
        """Load an injector file.

        Parameters
        ----------
        path : path, optional
            Injector file; without one, that of the bench file, else the nominal injector.
        bench : path, optional
            Bench file, whose `[recording]`, `[signals]` and `[sampling]` say how recordings were made.
        injector : str, optional
            Name of one of several on the bench.

        Raises
        ------
        UserError
            Naming file, key, problem and remedy.
        TypeError
            For other types.
        """
        model = None if path is None else path_of("path", path)
        stated = EXAMPLE_BENCH if bench is None else path_of("bench", bench)
        with naming_parameters():
            loaded = load_bench(stated, model, off_bus=True).of(injector)
        return cls(loaded, InjectorFile.read(loaded.injector.parameters_path))

    def __hash__(self) -> int:
        return hash(self.file)

    @property
    def parameters(self) -> InjectorParameters:
        """Parameters of the model [SI]."""
        return self.bench.injector.parameters

    def save(self, path: Pathlike, force: bool = False) -> None:
        """Write the injector file, with its comments.

        Parameters
        ----------
        path : path
            File to write.
        force : bool
            Whether an injector file that is there is replaced.

        Raises
        ------
        UserError, RunError
            For a path that is refused, and if writing fails.
        """
        check_output("save", Path(path), force, INJECTOR_FILE, consent=IN_A_CALL)
        write_text(Path(path), self.file.text)

    def fit(self, recordings: Recordings, masses: Pathlike | None = None) -> Self:
        """Fit the model, its structure included, to recordings of the healthy injector.

        Parameters
        ----------
        recordings : path, DataFrame, mapping of arrays, Recording, or a list of them
            At several rail pressures and durations, of one sample rate.
        masses : path, optional
            CSV of measured masses, `recording[,injection],mass_mg[,sigma_mg]`, which fix the absolute level.

        Returns
        -------
        Injector
            With the numbers found; its `calibration` says how well they explain the recordings.

        Raises
        ------
        UserError
            For recordings that cannot serve.
        RunError
            Where no structure of the model has a solution.
        """
        with noted() as notes:
            sources = sources_of(recordings, self.bench, notes.console)
            # Whole: masses go by all injections.
            most = MOST_SAMPLES if masses is None else sys.maxsize
            measured = self._measured(sources, notes, most)
            weighed = weighed_masses(measured, None if masses is None else path_of("masses", masses), self.parameters)
            with progress_bar(screen, "fitting", 1.0) as progress:
                sensors = calibration_of(self.bench.injector)
                fitted = fitted_model(self.parameters, measured, weighed, digests(sources), progress, sensors)
        with TemporaryDirectory() as folder:
            path = Path(folder) / _FITTED
            write_fitted(path, self.file, fitted.done, fitted.baseline)
            made = self._with_file(path)
        return replace(made, calibration=replace(fitted, notes=(*notes, *map(coverage, measured), *fitted.warnings)))

    def fit_map(self, masses: Pathlike) -> Self:
        """Fit nozzle, back pressure and needle to a map of masses, without any recording.

        Parameters
        ----------
        masses : path
            Table of rail pressure, energizing time, mass or volume, and where known their uncertainty and the back
            pressure, with units in the headings.

        Returns
        -------
        Injector
            With the numbers found; its `map_result` says how well they explain the map.

        Raises
        ------
        UserError
            For a table that cannot serve.
        RunError
            Where the model has no solution.
        """
        of = read_map(path_of("masses", masses), self.parameters.fluid.density_nozzle, FEWEST_POINTS)
        with progress_bar(screen, "fitting", 1.0) as progress:
            done = fit_map(self.parameters, of, progress)
        with TemporaryDirectory() as folder:
            path = Path(folder) / _FITTED
            write_map_fit(path, self.file, done)
            return replace(self._with_file(path), map_result=MapResult(done))

    def evaluate(
        self, recordings: Recordings, state: Pathlike | None = None, chain: bool = False, learn: bool = True
    ) -> EvaluationResult:
        """Run recordings through the observer.

        Parameters
        ----------
        recordings : path, DataFrame, mapping of arrays, Recording, or a list of them
            CAN logs, too, where the injector was loaded with a bench file.
        state : path, optional
            Learned state to begin with.
        chain : bool
            Whether the recordings are one history, learned from one after the other.
        learn : bool
            Whether they are learned from.

        Returns
        -------
        EvaluationResult
            Injections and samples as tables, a figure, what was learned.

        Raises
        ------
        UserError
            For recordings or a state that cannot serve.
        """
        with noted() as notes:
            sources = sources_of(recordings, self.bench, notes.console)
            look_over(self.bench, sources, notes.console)
            before = None if state is None else path_of("state", state)
            knowledge = starting_knowledge("state", before, self.parameters, partial(say, notes.console))
            with progress_bar(screen, "evaluating", sum(source.samples for source in sources)) as progress:
                c = self.bench.injector.coefficients
                evaluations, knowledge = evaluate_runs(self.bench, sources, knowledge, learn, chain, progress, c)
        return EvaluationResult(self.bench.injector, tuple(evaluations), knowledge, tuple(notes))

    def discover(
        self, recordings: Recordings, healthy: Recordings | None = None, choose: str = "", accept_term: int = 0
    ) -> "DiscoveryResult":
        """Find the physical effect that the model is missing, its size and how sure that is.

        Parameters
        ----------
        recordings : path, DataFrame, mapping of arrays, Recording, or a list of them
            At least three rail pressures and two durations tell most.
        healthy : the same, optional
            Recordings of a healthy injector to judge the model by.
        choose : str
            Effect for the amended model, where several explain the recordings as well; `ID+ID` for two.
        accept_term : int
            Number of the proposed law that the amended model is to have; 0: none. What a law leaves widens all
            intervals.

        Returns
        -------
        Discovery
            Verdict, effects, proposals, amended model and report.

        Raises
        ------
        UserError
            For recordings that cannot serve.
        """
        with noted() as notes:
            sources = sources_of(recordings, self.bench, notes.console)
            references = [] if healthy is None else sources_of(healthy, self.bench, notes.console)
            measured = self._measured([*sources, *references], notes)
            task = DiscoveryTask(
                self.parameters,
                measured[: len(sources)],
                measured[len(sources) :],
                digests(sources),
                effects_named("choose", choose),
                accept_term,
                observer_remainder,
                learn_laws,
            )
            refuse_incomparable(task, self.file.name)
            with progress_bar(screen, "looking for what is missing", 1.0) as progress:
                findings = answer(task, progress)
            return DiscoveryResult(self, task, findings, (*notes, *map(coverage, measured)))

    def _with_file(self, path: Path) -> Self:
        """The injector of another file, on this bench."""
        bench = self.bench.with_parameters(load_injector(path))
        return replace(self, bench=bench, file=InjectorFile.read(path), calibration=None, map_result=None)

    def _measured(
        self, sources: Sequence[SignalStream], notes: CallNotes, most: int = MOST_SAMPLES
    ) -> tuple[Measurement, ...]:
        stated = effects_on_one_raster(self.bench.injector.config.signals, self.bench.injector.location)
        return measured_recordings(sources, self.parameters, notes.console, most, stated)

    def __repr__(self) -> str:
        return "\n".join(self._lines)

    def _repr_html_(self) -> str:
        return "".join(f"<p>{escape(line)}</p>" for line in self._lines)

    @property
    def _lines(self) -> list[str]:
        """Name of the file, line model, fit, and the effects in force."""
        baseline, line = self.parameters.baseline, self.parameters.line
        lines = [f"Injector of {self.file.name}: line {line.model}"]
        if baseline is not None:
            verdict = "adequate" if baseline.adequate else "not adequate"
            lines.append(f"fitted {baseline.date} to {len(baseline.recordings)} recordings, {verdict}")
        lines += [f"in force: {words}" for words in self.parameters.in_force]
        return lines


PROPOSAL: dict[str, Callable[[Proposal], Any]] = {
    "words": lambda proposal: proposal.sentence,
    "laws": lambda proposal: "; ".join(map(law_text, proposal.terms)),
    "gap_before_MPa": lambda proposal: proposal.held_out[0] / MEGAPASCAL,
    "gap_after_MPa": lambda proposal: proposal.held_out[1] / MEGAPASCAL,
    "may_enter": lambda proposal: proposal.may_enter,
    "in_part": lambda proposal: proposal.part is not None,
    "refused": lambda proposal: "" if proposal.refusal is None else proposal.refusal.reason,
}
"""Columns of a table of proposals."""


@dataclass(frozen=True, eq=False, repr=False)
class DiscoveryResult:
    """Answer of a search, and what it rests on; injector: with its model; notes: of reading the recordings."""

    injector: Injector
    task: DiscoveryTask
    findings: Findings
    notes: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """`none`, `named`, `ambiguous` or `unknown`."""
        return str(self.findings.verdict)

    @property
    def confidence(self) -> float:
        """Confidence that the verdict is right."""
        return self.findings.confidence

    @cached_property
    def effects(self) -> pd.DataFrame:
        """Effects named, a row a parameter: value, 95 % interval, unit."""
        rows = [
            (effect.id, VOCABULARY[effect.id].sentence, name, size.value, *size.ci95, size.unit)
            for effect in self.findings.effects
            for name, size in effect.parameters.items()
        ]
        return pd.DataFrame(rows, columns=["effect", "meaning", "parameter", "value", "low", "high", "unit"])

    @cached_property
    def proposals(self) -> pd.DataFrame:
        """Laws outside the vocabulary, the best first; index: their numbers, for `accept_term`."""
        proposals = self.findings.proposals
        columns = {name: [of(proposal) for proposal in proposals] for name, of in PROPOSAL.items()}
        return pd.DataFrame(columns, index=pd.RangeIndex(1, len(proposals) + 1, name="number"))

    @cached_property
    def amended(self) -> Injector | None:
        """The injector with what was found; None where nothing may be added: see `findings.not_accepted`."""
        if self.findings.amended_model is None:
            return None
        with TemporaryDirectory() as folder:
            self._write(Path(folder))
            return self.injector._with_file(Path(folder) / AMENDED)

    def report(self, folder: Pathlike, force: bool = False) -> Path:
        """Write report, findings and amended model into a folder.

        Parameters
        ----------
        folder : path
            New folder, or that of an earlier report.
        force : bool
            Whether an earlier report there is replaced.

        Returns
        -------
        Path
            The page of the report.

        Raises
        ------
        UserError
            For a folder that cannot be written.
        """
        check_answer_folder(Path(folder), None, force)
        make_folder("report", Path(folder))
        self._write(Path(folder))
        return Path(folder) / REPORT

    def _write(self, folder: Path) -> None:
        write_findings(folder, self.task, self.findings, self.injector.file)

    def __repr__(self) -> str:
        return as_text(self.findings)

    def _repr_html_(self) -> str:
        return f"<pre>{escape(as_text(self.findings))}</pre>"
