"""Messages to the browser, read back."""

import json

import numpy as np
from numpy.typing import NDArray

_WIDTH = 4  # bytes of a number


def unpacked(message: bytes) -> tuple[int, dict[str, str], dict[str, dict[str, NDArray[np.float32]]]]:
    """Its number, letters by the element of the page, columns by panel and name."""
    place = _WIDTH + int.from_bytes(message[:_WIDTH], "little")
    said = json.loads(message[_WIDTH:place])
    values = np.frombuffer(message, "<f4", offset=place)
    parts = said["parts"]
    letters = {name: part for name, part in parts.items() if isinstance(part, str)}
    columns = {}
    for name, part in parts.items():
        if name not in letters:
            ends = part["start"] + np.cumsum([0, *part["lengths"].values()])
            stretches = zip(part["lengths"], ends[:-1], ends[1:], strict=True)
            columns[name] = {column: values[first:end] for column, first, end in stretches}
    return said["number"], letters, columns
