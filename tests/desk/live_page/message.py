"""Messages to the browser, read back."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray


def unpacked(message: bytes) -> tuple[dict[str, Any], dict[str, dict[str, NDArray[np.float32]]]]:
    """Its text, and the columns by panel and name."""
    place = 4 + int.from_bytes(message[:4], "little")
    said = json.loads(message[4:place])
    values = np.frombuffer(message, "<f4", offset=place)
    columns: dict[str, dict[str, NDArray[np.float32]]] = {}
    start = 0
    for part, lengths in said.pop("columns").items():
        columns[part] = {}
        for name, length in lengths.items():
            columns[part][name] = values[start : start + length]
            start += length
    assert start == values.size
    return said, columns
