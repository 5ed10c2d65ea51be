"""Golden events: what reached a learner and what came of it, as files hold it, and how far other outcomes are off."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from hashlib import blake2b
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.engine.learning.learner_adapter import GOLDEN, Chain, Named, learning_of
from tests.engine.learning.strokes import stroke_of

CHAINS, INPUTS, OUTCOMES = GOLDEN / "chains.json", GOLDEN / "inputs.npz", GOLDEN / "outcomes.npz"
FLOOR = 1e-6  # of the largest number of an array, below which a difference is relative to that
BELIEF = "state.account.learned.belief"
VARIANCES = {"estimate": "covariance shown", f"{BELIEF}.mean": f"{BELIEF}.covariance shown"}
"""Of what is known with standard deviations, and is off by so many."""


class Difference(NamedTuple):
    """Between two outcomes; relative: inf of texts and sizes, 0 of bits within what a digest stands for."""

    relative: float
    sigmas: float
    name: str
    text: str


def write(path: Path, events: Sequence[Named], machine: Mapping[str, str]) -> None:
    """Arrays and texts of events into a file, exactly; of arrays with few values their places among these."""
    pooled: dict[str, list[NDArray[Any]]] = {}
    for event in events:
        for name, value in event.items():
            if not isinstance(value, str):
                pooled.setdefault(name, []).append(value.ravel())
    layout = [{name: v if isinstance(v, str) else v.shape for name, v in event.items()} for event in events]
    content: dict[str, Any] = {"": np.frombuffer(json.dumps([layout, machine]).encode(), np.uint8)}
    for name, parts in pooled.items():
        content[name] = values = np.concatenate(parts)
        table, places = np.unique(values.view(np.uint64) if values.itemsize == 8 else values, return_inverse=True)
        if values.itemsize == 8 and 2 * table.size < values.size and table.size < 1 << 16:
            content[f"{name}@"] = table.view(values.dtype)
            content[name] = places.astype("<u2").view(np.uint8).reshape(-1, 2).T.copy()
    np.savez_compressed(path, **content)


@cache
def read(path: Path) -> tuple[list[Named], dict[str, str]]:
    with np.load(path) as file:
        content: dict[str, NDArray[Any]] = dict(file)
    layout, machine = json.loads(content.pop("").tobytes())
    for name in [each.removesuffix("@") for each in content if each.endswith("@")]:
        content[name] = content[f"{name}@"][content[name].T.copy().view("<u2").ravel()]
    events, begun = list[Named](), dict.fromkeys(content, 0)
    for shapes in layout:
        event: Named = {name: shape for name, shape in shapes.items() if isinstance(shape, str)}
        for name in shapes.keys() - event.keys():
            begin, begun[name] = begun[name], begun[name] + math.prod(shapes[name])
            event[name] = content[name][begin : begun[name]].reshape(shapes[name])
        events.append(event)
    return events, machine


def recorded(path: Path) -> Iterator[tuple[Chain, list[Named]]]:
    events = iter(read(path)[0])
    for fields in json.loads(CHAINS.read_text()):
        yield (chain := Chain(**fields)), [next(events) for _ in range(chain.events)]


def outcomes(chain: Chain) -> Iterator[Named]:
    return map(learning_of(chain), next(events for each, events in recorded(INPUTS) if each == chain))


def machine() -> dict[str, str]:
    """What the last digits depend on: numpy, its linear algebra on this processor, and how the core is compiled."""
    random = np.random.default_rng(1).normal(size=(94, 94))
    square = random @ random.T
    algebra = square, np.linalg.inv(square), np.linalg.cholesky(square), np.exp(random), np.log(np.abs(random))
    parts = {"linear algebra": np.concatenate(algebra).tobytes(), "core": stroke_of().output.tobytes()}
    return {
        "numpy": np.__version__,
        **{name: blake2b(part, digest_size=8).hexdigest() for name, part in parts.items()},
    }


def differences(golden: Named, now: Named) -> list[Difference]:
    apart = []
    for name in dict.fromkeys([*golden, *now]):
        before, after = golden.get(name, "missing"), now.get(name, "missing")
        if isinstance(before, str) or isinstance(after, str) or before.shape != after.shape:
            if isinstance(before, str) is not isinstance(after, str) or not np.array_equal(before, after):
                texts = (each if isinstance(each, str) else str(each.shape) for each in (before, after))
                apart.append(Difference(math.inf, 0.0, name, " -> ".join(texts)))
        elif before.tobytes() != after.tobytes():
            apart.append(_apart(name, before, after, golden))
    return sorted(apart, reverse=True)


def _apart(name: str, before: NDArray[Any], after: NDArray[Any], golden: Mapping[str, Any]) -> Difference:
    if name.endswith("#"):
        return Difference(0.0, 0.0, name, "other bits")
    is_same = (before == after) | (np.isnan(before) & np.isnan(after))
    off = np.abs(np.subtract(after, before, out=np.zeros_like(after), where=~is_same))
    size = np.maximum(np.abs(before), FLOOR * np.nan_to_num(np.abs(before), posinf=0.0).max(initial=0.0))
    sigma = np.sqrt(golden[VARIANCES[name]]) if name in VARIANCES else np.full_like(off, math.inf)
    sigmas = np.divide(off, sigma, out=np.zeros_like(off), where=off > 0.0)
    relative = np.divide(off, size, out=np.zeros_like(off), where=off > 0.0)
    at = int(np.argmax(np.nan_to_num(relative, nan=math.inf)))
    text = f"{before.flat[at]:.6g} -> {after.flat[at]:.6g} at {at}"
    largest = float(np.nan_to_num(relative.flat[at], nan=math.inf))
    return Difference(largest, float(sigmas.max(initial=0.0)), name, text)
