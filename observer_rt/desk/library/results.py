"""Results of evaluated recordings: injections and samples as tables, a figure, what was learned."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from observer_rt.config.bench import BenchInjector
from observer_rt.desk.evaluation.curves import SHOWN
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.histories import write_state
from observer_rt.desk.evaluation.trace import TRACE_COLUMNS, trace_arrays
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.mass import VolumeBudget
from observer_rt.engine.reports.injection_report import Output, columns_of, row_of
from observer_rt.engine.stream.state import State
from observer_rt.foundation.errors import require
from observer_rt.foundation.outputs import IN_A_CALL, LEARNED_STATE, check_output
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.model.parameters import InjectorParameters

RECORDING = "recording"
_FIELDS = tuple(SHOWN.values())
_SHOWN_ROWS = 12
_OF_POINTS = ["value", "change", "ci95_halfwidth"]
_DECIMALS = {"start_s": 4, "rail_pressure_MPa": 1, "mass_mg": 2, "mass_bound_mg": 2}
_IN_SHORT = (RECORDING, "number", "start_s", "rail_pressure_MPa", "mass_mg", "mass_bound_mg", "valid", "reasons")


class KnowledgeHolder:
    """Has knowledge of an injector, and can write it."""

    @property
    def _learned(self) -> tuple[Knowledge, InjectorParameters]:
        """Knowledge, and the parameters of the model it belongs to."""
        raise NotImplementedError

    def save_state(self, path: str | PathLike[str], force: bool = False) -> None:
        """Write the learned state, for `state=` and `observer-rt run`.

        Parameters
        ----------
        path : path
            File to write.
        force : bool
            Whether a state that is there is replaced.

        Raises
        ------
        UserError, RunError
            For a path that is refused, and if writing fails.
        """
        check_output("save_state", Path(path), force, LEARNED_STATE, consent=IN_A_CALL)
        write_state(Path(path), *self._learned)


@dataclass(frozen=True, eq=False)
class EvaluationResult(KnowledgeHolder):
    """Recordings as the observer saw them, notes of reading them, and the knowledge learned in the end."""

    injector: BenchInjector
    evaluations: tuple[Evaluation, ...]
    knowledge: Knowledge
    notes: tuple[str, ...]

    @cached_property
    def injections(self) -> pd.DataFrame:
        """Injections, a row each: masses, wear, validity; units end the names."""
        c = self.injector.coefficients
        rows = [
            {RECORDING: _name(evaluation), **row_of(_FIELDS, Output.PARQUET, injection, c)}
            for evaluation in self.evaluations
            for injection in evaluation.injections
        ]
        return pd.DataFrame(rows, columns=[RECORDING, *columns_of(_FIELDS, Output.PARQUET)])

    @cached_property
    def budget(self) -> pd.DataFrame:
        """Uncertainty of the masses [mg, one sigma] by what makes it."""
        rows = [
            (_name(evaluation), result.number, *(sigma * result.density / MILLIGRAM for sigma in result.budget))
            for evaluation in self.evaluations
            for result in evaluation.injections
            if result.budget is not None
        ]
        return pd.DataFrame(rows, columns=[RECORDING, "number", *(f"by_{part}_mg" for part in VolumeBudget._fields)])

    @cached_property
    def learned(self) -> pd.DataFrame:
        """Laws of nozzle and seat as learned, a point a row: relative change of a flow over a variable."""
        laws = ((_name(run), law) for run in self.evaluations for law in run.learned if not law.is_surface)
        curves = [{RECORDING: name, **law.columns} for name, law in laws]
        table = pd.DataFrame(curves, columns=[RECORDING, "flow", "variable", *_OF_POINTS])
        return table.explode(_OF_POINTS, ignore_index=True).astype(dict.fromkeys(_OF_POINTS, float))

    @cached_property
    def trace(self) -> pd.DataFrame:
        """Samples, a row each: injection rate with its standard deviation, validity, states."""
        return pd.concat([_samples(evaluation) for evaluation in self.evaluations], ignore_index=True)

    @property
    def valid_share(self) -> float:
        """Share of the injections whose rate and mass are to be used; nan without any."""
        return float(self.injections.valid.mean()) if len(self.injections) else float("nan")

    def plot(self, injections: Sequence[int] = ()) -> Any:
        """Draw rates of injections, masses and wear.

        Parameters
        ----------
        injections : sequence of int
            Numbers of the injections whose rates are drawn; empty: the first, the middle and the last one.

        Returns
        -------
        Figure
            Of matplotlib.

        Raises
        ------
        UserError
            For a number that no injection has.
        """
        require("matplotlib")
        from observer_rt.desk.evaluation.figures import injections_figure, pictures_of

        return injections_figure(pictures_of(self.evaluations, injections), "measured")

    @property
    def _learned(self) -> tuple[Knowledge, InjectorParameters]:
        return self.knowledge, self.injector.parameters

    def __repr__(self) -> str:
        return f"{self._headline}\n{self._in_short.to_string(index=False)}"

    def _repr_html_(self) -> str:
        return f"<p>{self._headline}</p>{self._in_short.to_html(index=False, max_rows=_SHOWN_ROWS)}"

    @property
    def _headline(self) -> str:
        count = len(self.injections)
        recordings = f"{len(self.evaluations)} recording{'s' if len(self.evaluations) > 1 else ''}"
        valid = f"{count} injections of {recordings}, {int(self.injections.valid.sum())} of them valid"
        levels = [evaluation.level for evaluation in self.evaluations if evaluation.level]
        return f"{valid}; {levels[0]}" if levels else valid

    @property
    def _in_short(self) -> pd.DataFrame:
        return self.injections[list(_IN_SHORT if len(self.evaluations) > 1 else _IN_SHORT[1:])].round(_DECIMALS)


def _name(evaluation: Evaluation) -> str:
    return evaluation.path.name if evaluation.path is not None else ""


def _samples(evaluation: Evaluation) -> pd.DataFrame:
    trace = evaluation.trace
    arrays = dict(zip(TRACE_COLUMNS, trace_arrays(trace), strict=True))
    states = pd.Categorical.from_codes(trace.state, [state.name for state in State])
    recordings = pd.Categorical.from_codes(np.zeros(trace.size, int), [_name(evaluation)])
    return pd.DataFrame({RECORDING: recordings, **arrays, "state": states})
