"""Arrays of a file as texts, equal ones once: covariances by their Cholesky factors as float32, others to the bit.

Whatever rounding does to a factor, its square is positive definite; a rounded covariance may not be.
"""

import zlib
from base64 import b85decode, b85encode
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np

from observer_rt.foundation.units import Floats

FEWEST = 16  # numbers of an array that becomes a text; fewer are easier read as they are
_EXACT, _ROOT = "exact", "root"


class ArrayTexts:
    """Takes arrays out of numbers, lists and mappings, and puts them in again."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self.texts = list(texts)
        """Each `KIND SHAPE BASE85`, of numbers of 8 bytes, of a root of 4, little-endian, by zlib."""

    def take_out(self, value: Any) -> Any:
        """The value with the number of its text for each array. Raises ValueError for one that is not finite."""
        match value:
            case dict():
                return {name: self.take_out(part) for name, part in value.items()}
            case list():
                return [self.take_out(part) for part in value]
            case np.ndarray() if value.size >= FEWEST and value.dtype == np.float64:
                if (text := _text(value)) not in self.texts:
                    self.texts.append(text)
                return {"array": self.texts.index(text)}
        return value

    def put_in(self, value: Any) -> Any:
        """The inverse. Raises LookupError where a text is missing."""
        match value:
            case {"array": int(number)}:
                return _array(self.texts[number])
            case dict():
                return {name: self.put_in(part) for name, part in value.items()}
            case list():
                return [self.put_in(part) for part in value]
        return value


def _text(array: Floats) -> str:
    kind, data, size = _EXACT, array.astype("<f8"), array.shape[-1]
    if array.ndim > 1 and array.shape[-2] == size and np.array_equal(array, array.swapaxes(-1, -2)):
        with suppress(np.linalg.LinAlgError):  # not positive definite
            kind, data = _ROOT, np.linalg.cholesky(array)[..., *np.tril_indices(size)].astype("<f4")
    if not np.isfinite(data).all():
        raise ValueError("an array is not finite")
    return f"{kind} {'x'.join(map(str, array.shape))} {b85encode(zlib.compress(data.tobytes())).decode()}"


def _array(text: str) -> Floats:
    kind, shown, data = text.split()
    shape = tuple(map(int, shown.split("x")))
    values = np.frombuffer(zlib.decompress(b85decode(data)), "<f4" if kind == _ROOT else "<f8").astype(np.float64)
    if kind != _ROOT:
        return values.reshape(shape)
    root = np.zeros(shape)
    root[..., *np.tril_indices(shape[-1])] = values.reshape(*shape[:-2], -1)
    square = root @ root.swapaxes(-1, -2)
    return np.asarray(0.5 * (square + square.swapaxes(-1, -2)))
