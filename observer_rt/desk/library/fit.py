"""Calibration of a model, as `Injector.fit` gives it: verdict, parameters, residuals, a figure."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from observer_rt.desk.fitted_model import FittedModel
from observer_rt.foundation.errors import require
from observer_rt.identification.fit.document import FitDocument, document_of, verdict_words


@dataclass(frozen=True, eq=False, repr=False)
class FitResult:
    """A fit. notes: what was noted while recordings were read; warnings: doubts about them."""

    fitted: FittedModel
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def adequate(self) -> bool:
        """Whether the model explains its recordings."""
        return self.fitted.baseline.adequate

    @property
    def verdict(self) -> str:
        """Verdict in words, with what to try where it is not adequate."""
        return verdict_words(self.fitted.done)

    @cached_property
    def parameters(self) -> pd.DataFrame:
        """Parameters fitted, by name: value, 95 % interval, value of the file before, unit, symbol."""
        sizes = {name: asdict(one) for name, one in self.fitted.done.sizes.items()}
        frame = pd.DataFrame.from_dict(sizes, orient="index")
        low_high = pd.DataFrame(frame.pop("ci95").tolist(), index=frame.index, columns=["low", "high"])
        return frame[["symbol", "value"]].join(low_high).join(frame[["file", "unit"]])

    @cached_property
    def document(self) -> FitDocument:
        """All of it, as `observer-rt fit --json` writes it."""
        return document_of(self.fitted.done, self.fitted.baseline, self.warnings)

    def plot(self) -> Any:
        """Draw line pressures before and after the fit, and residuals by phase: a matplotlib Figure."""
        require("matplotlib")
        from observer_rt.identification.fit.report import fit_figure

        return fit_figure(self.fitted.done)

    def __repr__(self) -> str:
        return f"{self.verdict}\n{self.parameters.to_string()}"

    def _repr_html_(self) -> str:
        return f"<p>{self.verdict}</p>{self.parameters.to_html()}"
