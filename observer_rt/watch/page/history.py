"""Mass of every injection and the wear over them, with what is sure of each."""

from collections.abc import Sequence

import numpy as np
from bokeh.models import ColumnDataSource

from observer_rt.watch.injection import SeenInjection
from observer_rt.watch.page.drawing import Parts, Target
from observer_rt.watch.page.look import NOMINAL, NOT_VALID, OBSERVER, SECOND, panel, with_legend

_NAME = "history"
_SURE = 1.96  # standard deviations of a 95 % interval
_WEAR = (("nozzle", OBSERVER), ("seat", SECOND))


class History:
    """What became of one injector."""

    def __init__(self) -> None:
        mass, wear = (
            panel("Mass of each injection", "injection", "mg"),
            panel("Wear", "injection", "% of flow"),
        )
        self.figures = {"mass": mass, "wear": wear}
        self._source = ColumnDataSource({name: [] for name in _columns(())})
        source = self._source
        mass.segment("number", "mass_low", "number", "mass_high", source=source, color="colour", alpha=0.5)
        mass.scatter(
            "number", "nominal", source=source, color=NOMINAL, marker="dash", size=8, legend_label="nominal"
        )
        mass.scatter(
            "number", "mass", source=source, color="colour", size=6, legend_label="observer (red: not valid)"
        )
        for name, colour in _WEAR:
            wear.varea("number", f"{name}_low", f"{name}_high", source=source, color=colour, alpha=0.2)
            wear.line("number", name, source=source, color=colour, line_width=3, legend_label=name)
        for made in self.figures.values():
            with_legend(made)

    @property
    def targets(self) -> dict[str, Target]:
        """What its parts belong to."""
        return {_NAME: self._source}

    def parts(self, injections: Sequence[SeenInjection]) -> Parts:
        """All injections that are kept."""
        return {_NAME: _columns(injections)}


def _columns(injections: Sequence[SeenInjection]) -> dict[str, np.ndarray]:
    said = [each.summary for each in injections]
    is_valid = [each.valid == 1.0 for each in said]
    return {
        "number": np.array([each.injection_number for each in said]),
        "nominal": np.array([each.nominal_mass for each in injections]),
        "colour": np.where(is_valid, OBSERVER, NOT_VALID),
        **_banded("mass", [(each.mass, each.mass_sigma) for each in said]),
        **_banded("nozzle", [(100.0 * each.nozzle_wear, 100.0 * each.nozzle_wear_sigma) for each in said]),
        **_banded("seat", [(100.0 * each.seat_wear, 100.0 * each.seat_wear_sigma) for each in said]),
    }


def _banded(name: str, values: Sequence[tuple[float, float]]) -> dict[str, np.ndarray]:
    mean, sigma = np.array(values).reshape(-1, 2).T
    return {name: mean, f"{name}_low": mean - _SURE * sigma, f"{name}_high": mean + _SURE * sigma}
