"""Doubts about the signals of a recording that can be read, and refusals of those that teach nothing."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from observer_rt.config.signals import Role
from observer_rt.engine.signal_survey import OPEN, SWAPPED, Implausible, Survey, swapped, unshut
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE
from observer_rt.model.baseline import Baseline

LEAST_DIP = 2 * MEGAPASCAL  # by which a line pressure moves more than the rail's where a needle opens
PERFORATED = 0.01  # gaps a sample, from which on what is put in their place is no measurement
RANGE_FACTOR = 2.0  # times a fitted range of rail pressures


def refuse_dead(path: Path | None, survey: Survey, columns: dict[str, str] | None = None) -> None:
    """Raise `UserError` for a signal without a value, and a lift or line pressure that stays as the needle opens."""
    rail, lift, line = (survey.signals.get(name) for name in Role)
    export, sensor = "check its column, and how it was exported", "check its column and its sensor"
    empty = (name for name, signal in zip(Role, (rail, lift, line), strict=True) if signal and not signal.count)
    dead = [Implausible(name, "has no value at all", export) for name in empty]
    if not dead and rail is not None and lift is not None and line is not None:
        if lift.swing == 0.0 and line.swing > rail.swing + LEAST_DIP:
            still = f"is {lift.highest / MILLIMETRE:.4g} mm all the time"
            moves = f"the line pressure moves by {line.swing / MEGAPASCAL:.3g} MPa"
            dead.append(Implausible(Role.NEEDLE_LIFT, f"{still}, though {moves}", sensor))
        if line.swing == 0.0 and lift.highest > OPEN:
            still = f"never moves: it is {line.highest / MEGAPASCAL:.4g} MPa all the time"
            dead.append(Implausible(Role.LINE_PRESSURE, f"{still}, though the needle opens", sensor))
    for fault in dead[:1]:
        raise fault.error(path, (columns or {}).get(fault.signal, ""))


class SignalDoubt(NamedTuple):
    """A likely fault of a recording that can be read, and its remedy."""

    problem: str
    remedy: str

    def as_text(self, path: Path | None) -> str:
        """Text for the user."""
        return f"warning: {path or 'recording'}, {self.problem}\n  remedy: {self.remedy}"


def doubts(
    survey: Survey, baseline: Baseline | None = None, columns: Mapping[str, str] | None = None
) -> Iterator[SignalDoubt]:
    """Doubts by the ranges of a recording; baseline: of a model that was fitted; columns: names in the file."""
    if survey.swapped_in_part or swapped(survey):
        problem, remedy = SWAPPED
        first, second = ((columns or {}).get(name, "") for name in ("rail_pressure", "line_pressure"))
        named = f": '{second}' does what a rail's does, '{first}' what a line's does" if first and second else ""
        yield SignalDoubt(problem + named, remedy)
    lift = survey.signals.get("needle_lift")
    is_measured = lift is not None and lift.highest > OPEN and lift.lowest != 0.0  # Not computed without noise.
    yield from (SignalDoubt(f"{odd.signal} {odd.problem}", odd.remedy) for odd in unshut(survey))
    for name in ("rail_pressure", "line_pressure"):
        signal = survey.signals.get(name)
        if signal is not None and is_measured and signal.count and signal.swing == 0.0:
            yield SignalDoubt(
                f"{name} is {signal.mean / MEGAPASCAL:.4g} MPa all the time, though the needle opens",
                "give the measured pressure: a set value, or a dead sensor, makes no injection valid",
            )
    for name, signal in survey.signals.items():
        if signal.missing:
            yield SignalDoubt(
                f"{name}: {signal.as_missing}",
                "export all samples; short gaps are bridged, injections with longer ones are not valid",
            )
    rail = survey.signals.get("rail_pressure")
    if baseline is None or rail is None or not rail.count:
        return
    mean, (low, high) = rail.mean / MEGAPASCAL, baseline.rail_pressure_MPa
    if not low / RANGE_FACTOR < mean < high * RANGE_FACTOR:
        yield SignalDoubt(
            f"rail_pressure is {mean:.4g} MPa in the mean, and the model was fitted at {low:.4g} to {high:.4g} MPa",
            "check the unit of both pressures, or fit the model at such a rail pressure, too",
        )


def refuse_without_lift(stream: SignalStream, remedy: str) -> None:
    """Raise `UserError` for a recording without needle lift, where energizing cannot stand for it."""
    if not stream.has_lift:
        raise UserError(f"{stream.path or 'recording'}, needle_lift", "was not recorded", remedy)


def refuse_perforated(path: Path | None, survey: Survey) -> None:
    """Raise `UserError` where values are missing so often that what bridges them would be judged."""
    for name, signal in survey.signals.items():
        if signal.gaps > PERFORATED * (signal.count + signal.missing):
            remedy = "export all samples: values put between the others are no measurement"
            raise UserError(f"{path or 'recording'}, {name}", signal.as_missing, remedy)
