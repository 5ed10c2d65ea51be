"""The account of change as it goes from event to event: what may be so, and what a mass is unsure by."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from observer_rt.engine.learning.account.hypotheses import Possibility
from observer_rt.engine.learning.account.scatter import Scatter
from observer_rt.engine.learning.account.unexplained import UnexplainedPressure
from observer_rt.engine.learning.account.wander import Wander
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.foundation.records import Count


@dataclass(frozen=True, eq=False)
class MassDoubt:
    """What makes a mass less certain than a belief says."""

    wander: Wander = field(default_factory=Wander)
    unexplained: UnexplainedPressure = field(default_factory=UnexplainedPressure)
    scatter: Scatter = field(default_factory=Scatter)


@dataclass(frozen=True, eq=False)
class Account:
    """Hypotheses, the one that is carried first: one belief in its modes.

    settled: the last beliefs that nothing objected to for some events, which may come back, and with them
    `settled_doubt`; unobjected: events in a row without objection.
    """

    hypotheses: tuple[Possibility, ...]
    settled: tuple[LearnedInjector, ...] = ()
    unobjected: Count = 0
    doubt: MassDoubt = field(default_factory=MassDoubt)
    settled_doubt: MassDoubt = field(default_factory=MassDoubt)

    @classmethod
    def of(cls, learned: LearnedInjector) -> "Account":
        """Account with one hypothesis: it is so."""
        return cls((Possibility(0.0, learned),))

    @property
    def lead(self) -> Possibility:
        """The hypothesis that is carried."""
        return self.hypotheses[0]

    @property
    def beliefs(self) -> tuple[LearnedInjector, ...]:
        """All that is believed, or was."""
        return (*(each.learned for each in self.hypotheses), *self.settled)

    def map(self, change: Callable[[LearnedInjector], LearnedInjector]) -> "Account":
        """Account in which every hypothesis believes what the change makes of it."""
        changed = {id(h.learned): change(h.learned) for h in self.hypotheses}
        return replace(
            self,
            hypotheses=tuple(replace(h, learned=changed[id(h.learned)]) for h in self.hypotheses),
            settled=tuple(changed.get(id(each)) or change(each) for each in self.settled),
        )
