"""Judged event: the objections to it, what was learned from it, what the observer carries from it on."""

from dataclasses import dataclass

import numpy as np

from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.knowledge import Knowledge, Outcome
from observer_rt.engine.stream.state import Constants


@dataclass(frozen=True)
class Fuel:
    """Fuel at a temperature [K] (None: as in the injector file), and the observer's constants with it."""

    temperature: float | None
    constants: Constants


@dataclass(frozen=True, eq=False)
class EventRecord:
    """An event, `stream.state.EVENT`, that was judged.

    objections: what speaks against it; outcome: what was learned from it, None when nothing was; knowledge: what the
    observer carries now; fuel: during the event.
    """

    event: np.void
    objections: tuple[Objection, ...]
    outcome: Outcome | None
    knowledge: Knowledge
    fuel: Fuel
