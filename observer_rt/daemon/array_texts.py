"""Arrays of a file as texts, equal ones once: vectors to the bit, matrices as float32, covariances by their roots.

Whatever rounding does to a Cholesky factor, its square is positive definite; to the covariance it may not be.
"""

import zlib
from base64 import b85decode, b85encode
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

FEWEST = 16  # numbers of an array that becomes a text; fewer are easier read as they are
_MOST = 1 << 20  # bytes of an array, far more than any takes
_EXACT, _ROUNDED, _ROOT = "exact", "rounded", "root"


class ArrayTexts:
    """Takes arrays out of numbers, lists and mappings, and puts them in again."""

    def __init__(self, texts: Iterable[str] = ()) -> None:
        self.texts = list(texts)
        """Each `KIND SHAPE BASE85`, of numbers of 8 bytes, or 4 where they are rounded, little-endian, by zlib."""

    def take_out(self, value: Any) -> Any:
        """The value with the number of its text for each array. Raises ValueError for one that is not finite."""
        match value:
            case dict():
                return {name: self.take_out(each) for name, each in value.items()}
            case list():
                return [self.take_out(each) for each in value]
            case np.ndarray() if value.size >= FEWEST and value.dtype == np.float64:
                if (text := _text(value)) not in self.texts:
                    self.texts.append(text)
                return {"array": self.texts.index(text)}
        return value

    def put_in(self, value: Any) -> Any:
        """The inverse. Raises ValueError and LookupError where a text holds no array, or is missing."""
        match value:
            case {"array": int(number)}:
                return _array(self.texts[number])
            case dict():
                return {name: self.put_in(each) for name, each in value.items()}
            case list():
                return [self.put_in(each) for each in value]
        return value


def _text(array: NDArray[np.float64]) -> str:
    kind, size = _EXACT, array.shape[-1]
    values: NDArray[np.floating[Any]] = array
    if array.ndim > 1:
        kind = _ROUNDED
        if array.shape[-2] == size and np.array_equal(array, array.swapaxes(-1, -2)):
            with suppress(np.linalg.LinAlgError):  # not positive definite
                kind, values = _ROOT, np.linalg.cholesky(array)[..., *np.tril_indices(size)]
    data = values.astype("<f8" if kind == _EXACT else "<f4")
    if not np.isfinite(data).all():
        raise ValueError("an array is not finite")
    return f"{kind} {'x'.join(map(str, array.shape))} {b85encode(zlib.compress(data.tobytes())).decode()}"


def _array(text: str) -> NDArray[np.float64]:
    kind, shown, data = text.split()
    shape = tuple(map(int, shown.split("x")))
    try:
        numbers = zlib.decompressobj().decompress(b85decode(data), _MOST)
    except zlib.error as error:
        raise ValueError(f"an array is damaged: {error}") from None
    values = np.frombuffer(numbers, "<f8" if kind == _EXACT else "<f4").astype(np.float64)
    if not np.isfinite(values).all():
        raise ValueError("an array is not finite")
    if kind != _ROOT:
        return values.reshape(shape)
    size = shape[-1]
    lower = values.reshape(*shape[:-2], size * (size + 1) // 2)  # before a matrix of any size is made
    root = np.zeros(shape)
    root[..., *np.tril_indices(size)] = lower
    square = root @ root.swapaxes(-1, -2)
    return np.asarray(0.5 * (square + square.swapaxes(-1, -2)))
