"""Effects in how the needle answers its commands: they show where its lift is not recorded."""

from collections.abc import Sequence

from observer_rt.foundation.units import MICROMETRE, MICROSECOND
from observer_rt.model.effect import Component, Effect, Likeness, Proof, Relation, added, parameter, scaled
from observer_rt.model.effective import EffectiveModel


def _bounce(model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
    return added("needle", "bounce_length")(added("needle", "landing_bounce")(model, values), values[1:])


BESIDE = dict.fromkeys(("seat_area", "opening_speed"), ("opening_delay",)) | {
    "closing_delay": ("closing_speed",),
    "opening_delay": ("closing_delay",),
}
"""Effects that are fitted beside an effect of needle or seat, where it is to explain what is another one."""
_DELAY = (parameter("d", -300.0, 400.0, 8.0, (-80.0, 0.0, 80.0), "us", MICROSECOND),)
_SPEED = (parameter("r", -0.6, 1.5, 0.02),)

OPENING_DELAY = Effect(
    id="opening_delay",
    component=Component.NEEDLE,
    parameters=_DELAY,
    apply=added("needle", "opening_delay"),
    sentence="The needle leaves its seat later (or earlier) after the start of energizing than the file says, by d.",
    signature="The line pressure begins to fall later, and the injection is shorter, by the same time always.",
    relations=(
        Relation(("channel_skew",), Likeness.ALIKE, Proof.LIFT_RECORDED),
        Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.NEAR, Proof.LIFT_RECORDED),
    ),
)

OPENING_SPEED = Effect(
    id="opening_speed",
    component=Component.NEEDLE,
    parameters=_SPEED,
    apply=scaled("needle", "opening_speed"),
    sentence="The needle rises faster (or more slowly) than the file says: v (1 + r).",
    signature="Like a wider (or narrower) seat while the needle rises: the line pressure falls more steeply.",
    relations=(Relation(("seat_area", "lift_dependent_seat_coefficient"), Likeness.ALIKE, Proof.LIFT_RECORDED),),
)

CLOSING_DELAY = Effect(
    id="closing_delay",
    component=Component.NEEDLE,
    parameters=_DELAY,
    apply=added("needle", "closing_delay"),
    sentence="The needle begins to fall later (or earlier) after the end of energizing than the file says, by d.",
    signature="The injection ends later by the same time always, and is larger by as much.",
    relations=(Relation(("orifice_area", "seat_area"), Likeness.ALIKE, Proof.LIFT_RECORDED),),
)

CLOSING_SPEED = Effect(
    id="closing_speed",
    component=Component.NEEDLE,
    parameters=_SPEED,
    apply=scaled("needle", "closing_speed"),
    sentence="The needle falls faster (or more slowly) than the file says: v (1 + r).",
    signature="The line pressure recovers sooner, the more so the higher the needle had risen.",
    relations=(
        Relation(("seat_area",), Likeness.ALIKE, Proof.LIFT_RECORDED),
        Relation(("closing_delay",), Likeness.NEAR, Proof.LIFT_RECORDED),
    ),
)

NEEDLE_BOUNCE = Effect(
    id="needle_bounce",
    component=Component.NEEDLE,
    parameters=(
        parameter("b", 0.0, 80.0, 4.0, (0.0, 20.0), "um", MICROMETRE),
        parameter("l", -60.0, 80.0, 0.0, unit="us", si=MICROSECOND),
    ),
    apply=_bounce,
    sentence="The needle lifts once more, by b, when it has landed on its seat, for l longer than the file says.",
    signature="A little more is injected just after the needle has closed; the line pressure falls once more.",
    relations=(Relation(("closing_delay", "closing_speed"), Likeness.NEAR, Proof.LIFT_RECORDED),),
)
