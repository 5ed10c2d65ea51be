"""Numbers and units as people write them."""

_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}
"""Units as people write them, by those of files."""


def sign(unit: str) -> str:
    """A unit as people write it."""
    return _SIGNS.get(unit, unit)


def significant(uncertainty: float) -> float:
    """The unit of the second digit of an uncertainty: what a value is rounded to."""
    return 10.0 ** (int(f"{uncertainty:.0e}".split("e")[1]) - 1) if uncertainty > 0.0 else 0.0


def shown(value: float, step: float) -> str:
    """A value rounded to a step of 10^n; as short as it may be."""
    if not step > 0.0:
        return f"{value:.6g}"
    decimals = -int(f"{step:.0e}".split("e")[1])
    if -3 <= decimals <= 6:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    digits = 1 + max(0, int(f"{abs(value) or step:.0e}".split("e")[1]) + decimals)
    return f"{value:.{digits}g}"
