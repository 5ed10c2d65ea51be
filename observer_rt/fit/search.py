"""One structure fitted: coarse for comparison, and in full for the one that is chosen."""

from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.evidence.bounded_fit import Minimum, fit
from observer_rt.evidence.likelihood import JudgedModel
from observer_rt.fit.held_out import HeldOut, UnexplainedSignal, held_out, pooled
from observer_rt.fit.identifiability import Certainty, certainty
from observer_rt.fit.parts import Part, thinned
from observer_rt.fit.problem import Calibration
from observer_rt.fit.structures import FreeParameter, Structure, values_of, with_values
from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import MAX_SUBSTEPS, substeps_needed

ROUGH_EVENTS, ROUGH_ITERATIONS = 2, 8  # of an operating point, while structures are compared
FINE_EVENTS, FINE_ITERATIONS = 6, 8
MOST_FITS = 3  # of a structure, as its cells change with the sound speed found


@dataclass(frozen=True, eq=False)
class Fitted:
    """A structure at its best.

    judged: of every part there; left: of the line pressure on the recordings it was fitted to.
    """

    structure: Structure
    calibration: Calibration
    minimum: Minimum
    judged: Sequence[JudgedModel]
    left: UnexplainedSignal
    held_out: HeldOut | None

    @property
    def injector(self) -> InjectorParameters:
        """The injector fitted."""
        return self.calibration.injector(self.minimum.at.theta)

    @property
    def certainty(self) -> Certainty:
        """What is told of the parameters; residuals that are more than noise tell less."""
        return certainty(self.calibration, self.minimum.at, max(1.0, self.left.mean))


@dataclass(frozen=True)
class FailedStructure:
    """A structure that could not be fitted, with the reason."""

    structure: Structure
    reason: str


def fitted(
    structure: Structure,
    start: InjectorParameters,
    free: Sequence[FreeParameter],
    parts: Sequence[Part],
    iterations: int,
    spare: float = 1.0,
) -> Fitted | FailedStructure:
    """A structure fitted from the numbers of `start`.

    spare: as in `Structure.of`; a line that then has too few cells for its sound speed, or too many, is fitted again.
    """
    injector = structure.of(start, spare)
    needed = substeps_needed(injector, parts[0].measurement.recording.sample_rate)
    if needed > MAX_SUBSTEPS:
        return FailedStructure(
            structure, f"would need {needed} steps a sample, for its sac is small (at most {MAX_SUBSTEPS})"
        )
    try:
        calibration, found = _fit(injector, free, parts, iterations)
        for _ in range(MOST_FITS - 1):
            again = injector if found is None else structure.of(calibration.injector(found.at.theta))
            if again.line.cells == injector.line.cells:
                break
            injector = again
            calibration, found = _fit(injector, free, parts, iterations)
    except UserError as error:
        return FailedStructure(structure, error.problem)
    judged = None if found is None else calibration.judge_all(found.at.theta)
    if found is None or judged is None:
        return FailedStructure(
            structure, "has no finite solution on these recordings from the numbers it was started with"
        )
    left = pooled(calibration, judged)
    return Fitted(structure, calibration, found, judged, left, held_out(calibration, found.at))


def _fit(
    start: InjectorParameters, free: Sequence[FreeParameter], parts: Sequence[Part], iterations: int
) -> tuple[Calibration, Minimum | None]:
    calibration = Calibration(start, free, parts)
    return calibration, fit(calibration, calibration.centre, calibration.ranges, iterations)


def rough(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts structures are compared on."""
    return tuple(thinned(part, ROUGH_EVENTS) for part in parts)


def fine(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts the chosen structure is fitted to."""
    return tuple(thinned(part, FINE_EVENTS) for part in parts)


def settled(
    best: Fitted, start: InjectorParameters, parts: Sequence[Part]
) -> tuple[Fitted, tuple[FreeParameter, ...]]:
    """The chosen structure fitted to `parts`, and the parameters left to the file since the data do not tell them.

    start: the file's injector. One parameter at a time is left to the file, the one told worst: with it fixed the
    others may be told.
    """
    left_out: list[FreeParameter] = []
    free = list(best.calibration.free)
    now = best
    while True:
        numbers = _numbers_of(now.injector, best.structure.of(start), left_out)
        again = fitted(best.structure, numbers, free, parts, FINE_ITERATIONS)
        if isinstance(again, FailedStructure):
            return now, tuple(left_out)
        now = again
        untold = now.certainty.untold
        if untold is None or len(free) == 1:
            return now, tuple(left_out)
        left_out.append(untold)
        free.remove(untold)


def _numbers_of(
    injector: InjectorParameters, file: InjectorParameters, left_out: Sequence[FreeParameter]
) -> InjectorParameters:
    """An injector with the file's values of the parameters that are left to it."""
    return with_values(injector, left_out, values_of(file, left_out))
