"""Answer of a search for effects that a model is missing: verdict, effects, proposals, amended model, report."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd

from observer_rt.config.bench import load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.foundation.outputs import make_folder
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.amend import AMENDED
from observer_rt.identification.discovery.discover import DiscoveryTask
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.folder import REPORT, check_answer_folder, write_findings
from observer_rt.identification.discovery.law_words import law_text
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.model.effects import VOCABULARY

if TYPE_CHECKING:
    from observer_rt.desk.library.injector import Injector

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
    """Answer of a search. injector: whose model was searched; notes: remarks of reading the recordings."""

    injector: "Injector"
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
    def amended(self) -> "Injector | None":
        """The injector with what was found; None where nothing may be added: see `findings.not_accepted`."""
        if self.findings.amended_model is None:
            return None
        with TemporaryDirectory() as folder:
            self._write(Path(folder))
            path = Path(folder) / AMENDED
            bench = self.injector.bench.with_parameters(load_injector(path))
            return replace(self.injector, bench=bench, file=InjectorFile.read(path), calibration=None)

    def report(self, folder: str | PathLike[str], force: bool = False) -> Path:
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
