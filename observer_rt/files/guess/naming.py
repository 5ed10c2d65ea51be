"""What names and units of columns say: the signal, and the unit as the bench file writes it."""

import re
from collections.abc import Mapping

from observer_rt.files.signals.table import TIME
from observer_rt.files.signals.table_signals import UNITS

RATE = "injection_rate"
_WORDS = {  # in German, English and French, of names in small letters whose words stand apart
    TIME: r"\btime|zeit\b|\btemps\b|stamp\b|^ts?\b|^sec\b|^x\b|\bdatum\b|\bdate",
    "rail_pressure": r"rail|common|accumul|speicher|rampe|verteiler|\bp ?cr\b",
    "needle_lift": r"lift|hub\b|needle|nadel|lev[ée]e|aiguille|\bstroke|\bh ?n\b",
    "line_pressure": r"\bp?line|leitung|pipe|\btube|\bfeed|zulauf|inlet|conduite|ligne|\bp ?inj|\binj\w* p",
    RATE: r"\brate\b|\broi\b|verlauf|\bd[mvq] ?dt\b|taux|d[ée]bit",
}
_COMMANDED = r"\bset|soll|target|demand|desired|\bcmd|consigne"
_SPELLINGS = {
    "sec": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "µsec": "us",
    "micron": "um",
    "microns": "um",
    "mikrometer": "um",
    "mm3_per_ms": "mm3/ms",
    "mm3_per_s": "mm3/s",
    "m3_per_s": "m3/s",
    "mm^3/ms": "mm3/ms",
    "bara": "bar",
    "barg": "bar",
}
_GAUGE = re.compile(r"[ _]?(?:\((?:abs|a|g|rel)\)|abs|rel)\.?$", re.IGNORECASE)
_SUFFIX = re.compile(r"^(.+?)[_ .]([A-Za-zµμ][A-Za-z0-9µμ]*)$")


def signals_named(name: str) -> set[str]:
    """Signals that a name speaks of, among them that of the time; none for a value that is only commanded."""
    words = _apart(name.rpartition("/")[2] or name)
    if re.search(_COMMANDED, words):
        return set()
    found = {signal for signal, pattern in _WORDS.items() if re.search(pattern, words)}
    return found - {"line_pressure"} if "rail_pressure" in found and len(found) > 1 else found


def _apart(name: str) -> str:
    """A name in small letters, its words apart: `pRail_MPa`, `p-rail` as `p rail mpa`, `p rail`."""
    apart = re.sub(r"(?<=[a-zà-ÿ0-9])(?=[A-ZÀ-Þ])|(?<=[A-Za-z])(?=\d)", " ", name)
    return re.sub(r"[^a-zà-ÿµμ0-9]+", " ", apart.lower()).strip()


def known_unit(signal: str, unit: str) -> str:
    """A unit as it is written for a signal; empty where it is none of its units."""
    units = UNITS[signal]
    if unit in units:
        return unit
    unit = _GAUGE.sub("", unit)
    spelled = _SPELLINGS.get(unit.lower(), unit)
    small: Mapping[str, str] = {each.lower(): each for each in reversed(units)}
    return spelled if spelled in units else small.get(spelled.lower(), "")


def unit_in_name(signal: str, name: str) -> str:
    """The unit that a name ends with, as `rail_pressure_MPa`; empty for none."""
    for spelled in _SPELLINGS:
        if name.lower().endswith(f"_{spelled}") and (unit := known_unit(signal, spelled)):
            return unit
    found = _SUFFIX.match(name)
    return known_unit(signal, found[2]) if found else ""


def is_of_another_quantity(signal: str, unit: str) -> bool:
    """Whether a unit is that of another signal's quantity."""
    return not known_unit(signal, unit) and any(known_unit(other, unit) for other in UNITS if other != signal)
