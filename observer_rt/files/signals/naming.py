"""Which column is which signal, by the names and units of the headings: one table of aliases, in three languages."""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from observer_rt.config.injector_sections import RecordingConfig
from observer_rt.files.signals.recording import is_needed
from observer_rt.files.signals.table import TIME, Heading
from observer_rt.files.signals.table_signals import UNITS
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import spelled

_ALIASES = {  # in German, English and French, of names in small letters whose words stand apart
    TIME: r"\btime|zeit\b|\btemps\b|stamp\b|^ts?\b|^sec\b|^x\b|\bdatum\b|\bdate",
    "rail_pressure": r"rail|common|accumul|speicher|rampe|verteiler|\bp ?cr\b",
    "needle_lift": r"lift|hub\b|needle|nadel|lev[ée]e|aiguille|\bstroke|\bh ?n\b",
    "line_pressure": r"\bp?line|leitung|pipe|\btube|\bfeed|zulauf|inlet|conduite|ligne|\bp ?inj|\binj\w* p",
    "injection_rate": r"\brate\b|spritzrate\b|\broi\b|verlauf|\bd[mvq] ?dt\b|taux|d[ée]bit",
    "energizing": r"^(?:energi[sz]ing|bestromung|ansteuerung)$",
    "chamber_pressure": r"^chamber pressure\b",
    "fuel_temperature": r"^fuel temperature\b",
}
_OF_FLOW_METERS = ("l/min",)  # which show a mean, where a column beside the pressures has such a unit
_COMMANDED = r"\bset|soll|target|demand|desired|\bcmd|consigne"
_GAUGE = re.compile(r"[ _]?(?:\((?:abs|a|g|rel)\)|abs|rel)\.?$", re.IGNORECASE)
_NAME_AND_UNIT = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))$")
_SHOWN = 20  # columns
_WITHOUT = {TIME: "state rate_hz", "needle_lift": "have energizing, or x.shots.csv beside x.csv"}
BY_HEADINGS = "by its headings"


class HeadingChoice(NamedTuple):
    """Heading of a signal, None: none or several; problem: empty where the choice is certain."""

    signal: str
    heading: Heading | None
    unit: str = ""
    problem: str = ""


def layout_of(
    location: str, headings: Sequence[Heading], brings_time: bool = False, has_shots: bool = False
) -> RecordingConfig:
    """Mapping of a file of these headings. brings_time: no column is its time; has_shots: a table beside it.

    Raises `UserError` with the section to write where a signal has no heading or unit of its own, or several.
    """
    choices = [chosen(signal, headings) for signal in _ALIASES if signal != TIME or not brings_time]
    stands_in = has_shots or any(choice.signal == "energizing" and not choice.problem for choice in choices)
    headed = [choice for choice in choices if choice.heading is not None and choice.unit not in _OF_FLOW_METERS]
    needed = [choice for choice in choices if is_needed(choice.signal, stands_in) or choice in headed]
    problems = [f"{choice.signal}: {choice.problem}" for choice in needed if choice.problem]
    if problems:
        problem = f"its headings do not say which column is which signal: {'; '.join(problems)}"
        remedy = f"say it in a bench file, given by --bench:\n\n{_section(needed, headings)}\n"
        raise UserError(location, problem, remedy)
    return RecordingConfig.model_validate({choice.signal: dict(entries(choice)) for choice in needed})


def in_words(layout: RecordingConfig) -> str:
    """What headings say, in one line."""
    columns = ([(TIME, layout.time)] if layout.time is not None else []) + list(layout.signals)
    parts = (f"{name} is '{column.column}'{f' in {column.unit}' if column.unit else ''}" for name, column in columns)
    return f"{BY_HEADINGS} {', '.join(parts)}"


def name_and_unit(cell: str) -> tuple[str, str]:
    """`p_Rail [bar]` as both."""
    match = _NAME_AND_UNIT.match(cell)
    if match is None or not match["name"]:
        return cell, ""
    return match["name"], (match["square"] if match["square"] is not None else match["round"]).strip()


def is_unit(text: str) -> bool:
    """Whether a text is a unit of some signal."""
    return any(known_unit(signal, text) for signal in UNITS)


def known_unit(signal: str, unit: str) -> str:
    """Spelling of a unit in the list of a signal's units; empty if the signal has no such unit."""
    of_signal = UNITS.get(signal, {})
    return spelled(unit, of_signal) or spelled(_GAUGE.sub("", unit), of_signal)


def signals_named(name: str) -> set[str]:
    """Signals that a name speaks of, among them that of the time; none for a value that is only commanded."""
    bare = re.sub(r".*/(?!dt\b)(?=.)", "", name)  # without its device
    apart = re.sub(r"(?<=[a-zà-ÿ0-9])(?=[A-ZÀ-Þ])|(?<=[A-Za-z])(?=\d)", " ", bare)
    words = re.sub(r"[^a-zà-ÿµμ0-9]+", " ", apart.lower()).strip()
    if re.search(_COMMANDED, words):
        return set()
    signals = {signal for signal, pattern in _ALIASES.items() if re.search(pattern, words)}
    return signals - {"line_pressure"} if "rail_pressure" in signals and len(signals) > 1 else signals


def chosen(signal: str, headings: Sequence[Heading]) -> HeadingChoice:
    """The heading that names a signal."""
    named = {heading: unit_of(signal, heading) for heading in headings if signal in signals_named(heading.name)}
    has_none = signal not in UNITS  # a level
    fitting = {heading: unit for heading, unit in named.items() if unit or has_none or not heading.unit}
    several = {heading: unit for heading, unit in fitting.items() if unit or heading.is_calendar} or fitting
    if len(several) == 1:
        ((heading, unit),) = several.items()
        has_unit = unit or has_none or (signal == TIME and heading.is_calendar)
        return HeadingChoice(signal, heading, unit, "" if has_unit else f"'{heading.name}' has no unit")
    if named and not several:
        heading = next(iter(named))
        return HeadingChoice(signal, None, problem=f"'{heading.unit}' of '{heading.name}' is no unit of it")
    shown = " or ".join(
        f"'{heading.name}'" + ("" if heading.group is None else f" of group {heading.group}") for heading in several
    )
    return HeadingChoice(signal, None, problem=f"could be {shown}" if several else "no heading names it")


def unit_of(signal: str, heading: Heading) -> str:
    """Unit that is stated, or else ends the name, as `rail_pressure_MPa`."""
    if heading.unit or heading.is_calendar:
        return known_unit(signal, heading.unit)
    return unit_ending(heading.name, partial(known_unit, signal))


def unit_ending(name: str, spelling: Callable[[str], str]) -> str:
    """Unit that ends a name, as in `mass_mg`, by the spelling of an end; empty without one."""
    return next(filter(None, (spelling(name[end.end() :]) for end in re.finditer(r"[_ .]", name))), "")


def entries(choice: HeadingChoice) -> Iterator[tuple[str, str | int]]:
    """Keys of the column of a heading, with their values."""
    assert choice.heading is not None
    yield "column", choice.heading.name
    if choice.unit:
        yield "unit", choice.unit
    if choice.heading.group is not None:
        yield "group", choice.heading.group


def _section(choices: Sequence[HeadingChoice], headings: Sequence[Heading]) -> str:
    """The `[recording]` section, with places to fill in."""
    among = f'"..."  # one of {", ".join(choice.name for choice in headings[:_SHOWN])}'
    lines = ["[recording]"]
    for choice in choices:
        lines += ["", f"[recording.{choice.signal}]"]
        if choice.heading is None:
            end = f"; or leave out this part, and {_WITHOUT[choice.signal]}" if choice.signal in _WITHOUT else ""
            lines += [f"column = {among}{end}"]
        else:
            lines += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in entries(choice)]
        if not choice.unit and not (choice.heading is not None and choice.heading.is_calendar):
            lines += [f'unit = "..."  # one of {", ".join(UNITS[choice.signal])}']
    return "\n".join(lines)
