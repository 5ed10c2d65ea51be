"""Choice among candidates: time, lift by its pulses, rail and line by how far each moves while the needle is open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from observer_rt.files.guess.behaviour import (
    Pulses,
    movement,
    on_stamps,
    openings_of,
    time_units_possible,
    units_possible,
)
from observer_rt.files.guess.candidates import ColumnCandidate
from observer_rt.files.guess.naming import RATE
from observer_rt.files.signals.column import Values
from observer_rt.files.signals.table import TIME
from observer_rt.files.signals.table_signals import UNITS

_FARTHER = 1.4  # times, by which a line's pressure moves more than the rail's, beyond noise
_PRESSURES = ("rail_pressure", "line_pressure")
_MOST_PRESSURES = 8
_NANOSECONDS = "ns"
UNKNOWN = "..."  # a unit to be stated


@dataclass(frozen=True)
class Chosen:
    """Candidate chosen for a signal. why, doubt: in a few words; rate [Hz]: of a time."""

    candidate: ColumnCandidate
    unit: str
    why: str
    doubt: str = ""
    factor: float = 1.0
    offset: float = 0.0
    rate: float = 0.0
    rate_doubt: str = ""


def chosen_time(candidates: Sequence[ColumnCandidate]) -> Chosen | None:
    """The column that goes on evenly, by its name where several do."""
    rising = [each for each in candidates if each.stamps is not None]
    named = [each for each in rising if TIME in each.named or each.is_calendar]
    usable = [each for each in named or rising if each.is_calendar or _time_unit(each)[0]]
    if not usable:
        return None
    best = usable[0]
    assert best.stamps is not None
    unit, factor, possible = _time_unit(best)
    doubts = [] if named else ["its name does not say so"]
    if len(usable) > 1:
        doubts.append(f"could be {', '.join(each.column.name for each in usable[1:3])}, too")
    if not best.is_calendar and len(possible) > 1:
        doubts.append(f"its unit is not stated: {' or '.join(possible)}")
    seconds = 1.0 if best.is_calendar else UNITS[TIME][unit] * factor
    rate, rounding = best.stamps.rate(seconds), best.stamps.rounding * seconds
    told = f"stamps are rounded to {rounding * 1e3:.3g} ms: {rate:.10g} rows a second by their number"
    return Chosen(
        best,
        "" if best.is_calendar else unit,
        "rises evenly" + (", named so" if named else ""),
        "; ".join(doubts),
        factor,
        rate=rate,
        rate_doubt=told if rounding else "",
    )


def _time_unit(candidate: ColumnCandidate) -> tuple[str, float, tuple[str, ...]]:
    """Unit, the factor beside it, and the units possible where none is stated."""
    if _NANOSECONDS in (candidate.column.unit, candidate.column.name.rpartition("_")[2]):
        return "us", 1e-3, ()
    if stated := candidate.unit_of(TIME):
        return stated, 1.0, ()
    possible = (
        () if candidate.stamps is None or candidate.column.unit else time_units_possible(candidate.stamps)
    )
    return (possible[0] if possible else ""), 1.0, possible


def chosen_lift(candidates: Sequence[ColumnCandidate]) -> Chosen | None:
    """The column that rests and opens, by its name where several do."""
    scores = {
        each: each.score("needle_lift") + (2 if each.pulses else -1) - (3 if each.is_pressure else 0)
        for each in candidates
    }
    likely = [each for each in candidates if scores[each] >= 2 and each.score("needle_lift") >= 0]
    if not likely:
        return None
    best = max(likely, key=lambda each: scores[each])
    doubts = _name_doubts("needle_lift", best, [each for each in likely if scores[each] > scores[best] - 2])
    pulses = best.pulses
    factor, offset = 1.0, 0.0
    if pulses is None and not best.is_told("needle_lift"):
        doubts.append("it does not rest and open")
    elif pulses is not None and pulses.is_inverted:
        factor = -1.0
        offset = pulses.rest if abs(pulses.rest) > 0.2 * abs(pulses.height) else 0.0
        doubts.append("it goes down where the needle opens: inverted")
    unit, unit_doubt = _unit("needle_lift", best, best.values - (pulses.rest if pulses and offset else 0.0))
    why = ", ".join(_reasons("needle_lift", best, "rests and opens" if pulses else ""))
    return Chosen(best, unit, why, "; ".join([*doubts, *unit_doubt]), factor, float(f"{offset:.6g}"))


def chosen_pressures(candidates: Sequence[ColumnCandidate], lift: Chosen | None) -> dict[str, Chosen | None]:
    """Rail and line pressure: as they are named; what is not named, or moves otherwise, as it moves."""
    scores = {
        each: [each.score(signal) + (2 if each.is_pressure else -2) for signal in _PRESSURES]
        for each in candidates
    }
    likely = sorted(
        (each for each in candidates if max(scores[each]) >= 2), key=lambda each: -max(scores[each])
    )
    likely = likely[:_MOST_PRESSURES]
    if len(likely) < 2:
        return {
            signal: _pressure(signal, each, [], "")
            for signal in _PRESSURES
            for each in likely
            if signal in each.named
        }
    moves = _movements(likely, lift)

    def score(pair: tuple[ColumnCandidate, ColumnCandidate]) -> int:
        rail, line = pair
        return (
            scores[rail][0]
            + scores[line][1]
            + 3 * (_is_line(line, rail, moves) - _is_line(rail, line, moves))
        )

    rail, line = max(permutations(likely, 2), key=score)
    doubt = ""
    never_moves = np.nanmin(line.values) == np.nanmax(line.values)  # a dead sensor is no rail pressure
    if _is_line(rail, line, moves) and not never_moves:
        doubt = (
            f"'{rail.column.name}' moves farther than '{line.column.name}' while the needle is open, as a line's "
            "pressure does: most likely the two are exchanged, and are so here"
        )
        rail, line = line, rail
    result: dict[str, Chosen | None] = {}
    told = ("moves less", "moves with the lift") if _is_line(line, rail, moves) else ("", "")
    for place, each in enumerate((rail, line)):
        others = [
            other
            for other in likely
            if other not in (rail, line) and scores[other][place] > scores[each][place] - 2
        ]
        said = doubt and (f"see {_PRESSURES[0]}" if place else doubt)
        result[_PRESSURES[place]] = _pressure(_PRESSURES[place], each, [each, *others], said, told[place])
    return result


def _is_line(one: ColumnCandidate, other: ColumnCandidate, moves: Mapping[ColumnCandidate, float]) -> bool:
    """Whether one moves so much farther than the other, as a line's pressure beside the rail's."""
    return moves[one] > _FARTHER * moves[other]


def _pressure(
    signal: str, each: ColumnCandidate, likely: Sequence[ColumnCandidate], doubt: str, why: str = ""
) -> Chosen:
    doubts = [doubt] if doubt else _name_doubts(signal, each, likely)
    factor = 1.0
    if float(np.nanmedian(each.values)) < 0.0:
        factor = -1.0
        doubts.append("it is below zero: inverted")
    if not each.is_pressure and not each.is_told(signal):
        doubts.append("it does not look like a pressure")
    unit, unit_doubt = _unit(signal, each, each.values)
    return Chosen(
        each, unit, ", ".join(_reasons(signal, each, why)), "; ".join([*doubts, *unit_doubt]), factor
    )


def chosen_rate(candidates: Sequence[ColumnCandidate]) -> Chosen | None:
    """A measured injection rate: only by name and unit."""
    found = [each for each in candidates if RATE in each.named and each.unit_of(RATE)]
    return Chosen(found[0], found[0].unit_of(RATE), "name, unit") if len(found) == 1 else None


def _movements(pressures: Sequence[ColumnCandidate], lift: Chosen | None) -> dict[ColumnCandidate, float]:
    """How far each moves while the needle is open; NaN where that is not known."""
    pulses: Pulses | None = lift.candidate.pulses if lift is not None else None
    if lift is None or pulses is None:
        return dict.fromkeys(pressures, float("nan"))
    openings = openings_of(lift.candidate.values, pulses)
    at = lift.candidate.column.time
    return {
        each: movement(on_stamps(each.values, each.column.time, at), openings) / _middle(each)
        for each in pressures
    }


def _middle(candidate: ColumnCandidate) -> float:
    """Both pressures rest at the same, whatever their units."""
    return abs(float(np.nanmedian(candidate.values))) or 1.0


def _name_doubts(signal: str, chosen: ColumnCandidate, likely: Sequence[ColumnCandidate]) -> list[str]:
    doubts = [] if signal in chosen.named else ["its name does not say so"]
    if others := [each.column.name for each in likely if each is not chosen][:3]:
        doubts.append(f"could be {', '.join(others)}, too")
    return doubts


def _reasons(signal: str, chosen: ColumnCandidate, behaviour: str) -> list[str]:
    told = {"name": signal in chosen.named, "unit": bool(chosen.unit_of(signal)), behaviour: bool(behaviour)}
    return [reason for reason, is_there in told.items() if is_there]


def _unit(signal: str, candidate: ColumnCandidate, values: Values) -> tuple[str, list[str]]:
    """Unit of a signal, and what is doubtful about it."""
    possible = units_possible(signal, values)
    stated = candidate.unit_of(signal)
    if stated:
        return stated, []
    if candidate.is_raw():
        return UNKNOWN, [f"it is in {candidate.column.unit}: state factor, offset and unit"]
    if len(possible) == 1:
        return possible[0], []
    said = f"{' or '.join(possible)}" if possible else "none fits its values"
    return possible[0] if possible else UNKNOWN, [f"its unit is not stated: {said}"]
