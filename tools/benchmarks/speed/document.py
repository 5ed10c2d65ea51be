"""Figures as JSON can say them."""

import math
from typing import Any


def finite(value: Any) -> Any:
    """The same with None in the place of what is no finite number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
