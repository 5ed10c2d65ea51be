"""What the learning observer says of the same recordings, and whether it contradicts the discovery."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from observer_rt.discovery.search.result import Discovery, Verdict
from observer_rt.model.effects import VOCABULARY

SIGNIFICANT = 4.0  # standard deviations
AGREES = 0.1  # of the larger size, that both may differ besides their intervals


@dataclass(frozen=True)
class Indicator:
    """One of the observer's figures, as the effect it stands for (SI). sigma: standard deviation, nan unknown."""

    effect_id: str
    value: float
    sigma: float

    @property
    def stands_out(self) -> bool:
        """Whether it is beyond its own uncertainty and the effect's dead zone."""
        parameter = VOCABULARY[self.effect_id].parameters[0]
        return abs(self.value) > max(parameter.dead_zone, SIGNIFICANT * self.sigma)


@dataclass(frozen=True)
class Opinion:
    """The observer after it learned from all recordings, one after another.

    indicators: at the last injection; valid, injections: how many of them it declared valid; reasons: how often each
    reason for `not valid` was given, but for those of a start.
    """

    indicators: tuple[Indicator, ...]
    valid: int
    injections: int
    reasons: Mapping[str, int]


def contradictions(found: Discovery, opinion: Opinion) -> tuple[str, ...]:
    """Where both say what cannot both be true, each in a sentence."""
    if found.verdict is Verdict.UNKNOWN:
        return ()
    if found.verdict is Verdict.NONE:
        return tuple(_of_nothing(opinion))
    return tuple(_of_effects(found, opinion))


def remark(found: Discovery, opinion: Opinion) -> str:
    """What a reader must know of the observer's figures, in a sentence."""
    known = {indicator.effect_id for indicator in opinion.indicators}
    foreign = [effect.id for effect in found.effects if effect.id not in known]
    if foreign:
        return (
            f"The observer has no term for {' and '.join(foreign)} and puts it down to what it knows; with the "
            "amended model in force it need not."
        )
    if _inadequate(opinion):
        return (
            "It finds its model inadequate on some of these injections: its figures are not to be believed."
        )
    return ""


def _of_nothing(opinion: Opinion) -> list[str]:
    result = [
        f"discovery finds nothing missing, the observer learned {indicator.effect_id}"
        for indicator in opinion.indicators
        if indicator.stands_out
    ]
    inadequate = _inadequate(opinion)
    if inadequate:
        result.append(
            f"discovery finds the model adequate, the observer finds it inadequate in {inadequate} of "
            f"{opinion.injections} injections"
        )
    return result


def _inadequate(opinion: Opinion) -> int:
    """Injections that contradict the observer's model, whichever cause it names."""
    return opinion.reasons.get("MODEL_INADEQUATE", 0) + opinion.reasons.get("LIFT_SENSOR_LAG", 0)


def _of_effects(found: Discovery, opinion: Opinion) -> list[str]:
    """Compared only where the observer has a term for everything found: elsewhere it must put it down to others."""
    by_id = {indicator.effect_id: indicator for indicator in opinion.indicators}
    named = {effect.id: effect for effect in found.effects}
    if not set(named) <= set(by_id):
        return []
    result = []
    for effect_id, effect in named.items():
        ours, (low, high) = effect.parameters[0].value, effect.parameters[0].ci95
        theirs = by_id[effect_id]
        sigma = math.hypot((high - low) / 4.0, 0.0 if math.isnan(theirs.sigma) else theirs.sigma)
        allowed = SIGNIFICANT * sigma + AGREES * max(abs(ours), abs(theirs.value))
        if abs(ours - theirs.value) > allowed:
            result.append(f"both see {effect_id}, but of different size")
    like = {other for effect in found.effects for other in effect.indistinguishable_from}
    result += [
        f"the observer learned {indicator.effect_id} besides"
        for indicator in opinion.indicators
        if indicator.stands_out and indicator.effect_id not in like | set(named)
    ]
    return result
