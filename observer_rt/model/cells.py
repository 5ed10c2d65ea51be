"""Cells of a line in which pressure travels: too many for its sound speed are refused with the numbers."""

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.line.wave import STABLE, cells_for, steps_over
from observer_rt.model.parameters import InjectorParameters


def refuse_unstable_cells(
    place: str, injector: InjectorParameters, coefficients: Coefficients, interval: float
) -> None:
    """Raise `UserError` where steps of a sample interval [s] are too long for the cells.

    place: name of the injector file; coefficients: of the injector, with its effects.
    """
    line = coefficients.line
    if not line.staggered:
        return
    step = interval / steps_over(interval)
    strain = line.strain(step)
    if strain >= STABLE:
        raise UserError(
            f"{place}: line.cells",
            f"{line.cells:.0f} cells are not stable: sound crosses {line.crossing * step:.3g} of a cell in a step of "
            f"{step / MICROSECOND:.3g} us and {2.0 * line.damping * step:.2g} is left of it to damping, with the "
            f"closed end {strain:.3g} (at most {STABLE:g})",
            f"give {cells_for(injector, step)} cells, or leave 'cells' out",
        )
