"""An injector as the library has it: its model, and methods to fit it, evaluate recordings, and discover effects."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from html import escape
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Self

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.config.effects import effects_named
from observer_rt.config.injector_file import InjectorFile
from observer_rt.config.signals import effects_on_one_raster
from observer_rt.desk.evaluation.healthy_events import learned_laws, observer_remainder
from observer_rt.desk.evaluation.histories import begun_with, look_over, run_by_run
from observer_rt.desk.library.discovery import DiscoveryResult
from observer_rt.desk.library.fit import FitResult, fitted_model
from observer_rt.desk.library.notes import CallNotes, naming_parameters, noted, screen
from observer_rt.desk.library.recordings import Recordings, digests, path_of, sources_of
from observer_rt.desk.library.results import EvaluationResult
from observer_rt.engine.service.injector import calibration_of
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.files import write_text
from observer_rt.foundation.outputs import IN_A_CALL, INJECTOR_FILE, check_output
from observer_rt.identification.discovery.discover import DiscoveryTask, answer, refuse_incomparable
from observer_rt.identification.fit.calibrate import write_fitted
from observer_rt.identification.fit.folds import refuse_clipped
from observer_rt.identification.fit.masses import read_masses
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import coverage, read_measured, refuse_rates_missing
from observer_rt.model.parameters import InjectorParameters

Pathlike = str | PathLike[str]
_FITTED = "fitted.toml"


@dataclass(frozen=True, repr=False)
class Injector:
    """Model of an injector, from an injector file, and the bench it is on. Never changes: `fit` gives another.

    Two injectors of the same files are equal. calibration: set by `fit`; None of an injector that was loaded.
    """

    bench: Bench
    file: InjectorFile
    calibration: FitResult | None = field(default=None, compare=False)

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
            CSV of measured mean masses, `recording,mass_mg[,sigma_mg]`, which fix the absolute level.

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
            # Whole: a mass is the mean of all injections.
            most = MOST_SAMPLES if masses is None else sys.maxsize
            measured = self._measured(sources, notes, most)
            refuse_rates_missing([measurement.recording for measurement in measured])
            refuse_clipped(measured)
            density = self.bench.injector.coefficients.density
            weighed = {} if masses is None else read_masses(path_of("masses", masses), measured, density)
            with progress_bar(screen, "fitting", 1.0) as progress:
                sensors = calibration_of(self.bench.injector)
                fitted = fitted_model(self.parameters, measured, weighed, digests(sources), progress, sensors)
        with TemporaryDirectory() as folder:
            path = Path(folder) / _FITTED
            write_fitted(path, self.file, fitted.done, fitted.baseline)
            bench, file = self.bench.with_parameters(load_injector(path)), InjectorFile.read(path)
        remarks = (*notes, *map(coverage, measured), *fitted.warnings)
        return replace(self, bench=bench, file=file, calibration=replace(fitted, notes=remarks))

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
            knowledge = begun_with("state", before, self.parameters, partial(say, notes.console))
            with progress_bar(screen, "evaluating", sum(source.samples for source in sources)) as progress:
                c = self.bench.injector.coefficients
                evaluations, knowledge = run_by_run(self.bench, sources, knowledge, learn, chain, progress, c)
        return EvaluationResult(self.bench.injector, tuple(evaluations), knowledge, tuple(notes))

    def discover(
        self, recordings: Recordings, healthy: Recordings | None = None, choose: str = "", accept_term: int = 0
    ) -> DiscoveryResult:
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
                learned_laws,
            )
            refuse_incomparable(task, self.file.name)
            with progress_bar(screen, "looking for what is missing", 1.0) as progress:
                findings = answer(task, progress)
            remarks = (*notes, *map(coverage, measured))
            return DiscoveryResult(self, task, findings, remarks)

    def _measured(
        self, sources: Sequence[SignalStream], notes: CallNotes, most: int = MOST_SAMPLES
    ) -> tuple[Measurement, ...]:
        """Looks for injections."""
        named = {source.path: source for source in sources if source.path is not None}
        paths = [source.path for source in sources if source.path is not None]
        stated = effects_on_one_raster(self.bench.injector.config.signals, self.bench.injector.location)
        return read_measured(paths, named.__getitem__, self.parameters, notes.console, most, stated)

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
