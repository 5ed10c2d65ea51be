"""From measured lift to seat area: dead band with hysteresis, look-back to the foot of the ramp."""

from numba import njit

from observer_rt.model.laws import seat_area
from observer_rt.observer.state import RING, Observer

LOOK_BACK = 3  # samples before the crossing of the dead band whose raw lift counts
DEAD_BAND_SIGMAS = 5.0
DEAD_BAND_FLOOR = 2.0e-6  # m
CONFIRM = 2  # consecutive samples that decide
FOOT = 0.3  # of the dead band, above which these samples are the foot of a ramp
LOOKAHEAD = LOOK_BACK + CONFIRM - 1  # samples the front end must know beyond the one in hand
_MASK = RING - 1


def dead_band(lift_noise: float) -> tuple[float, float]:
    """Lift [m] above which the needle is open and below which it is shut again, from the lift noise [m]."""
    opens = max(DEAD_BAND_FLOOR, DEAD_BAND_SIGMAS * lift_noise)
    return opens, 0.5 * opens


@njit(cache=True, nogil=True)
def known(observer: Observer, position: int) -> int:
    """How many samples after `position` are received and follow it without a break (at most LOOKAHEAD)."""
    count = 0
    received = observer.memory[0].received
    while (
        count < LOOKAHEAD
        and position + count + 1 < received
        and observer.ring[(position + count + 1) & _MASK].broken == 0
    ):
        count += 1
    return count


@njit(cache=True, nogil=True)
def opens_at(observer: Observer, position: int) -> bool:
    """Whether the needle counts as open from `position` on: it crosses the dead band there, or soon after."""
    return bool(opens_within(observer, position, known(observer, position)))


@njit(cache=True, nogil=True)
def opens_within(observer: Observer, position: int, samples: int) -> bool:
    """`opens_at`, from what is known of the next `samples` samples.

    Up to LOOK_BACK samples before the crossing belong to the opening while they stand out of the noise.
    """
    threshold = observer.memory[0].lift_on
    run = 0
    for ahead in range(samples + 1):
        lift = observer.ring[(position + ahead) & _MASK].needle_lift
        if lift > threshold:
            run += 1
            if run == CONFIRM:
                return True
        elif run > 0 or lift < FOOT * threshold:
            return False
    return False


@njit(cache=True, nogil=True)
def closes_at(observer: Observer, position: int) -> bool:
    """Whether an open needle counts as closed from `position` on (not while the ramp is still to come)."""
    threshold = observer.memory[0].lift_off
    for ahead in range(min(known(observer, position) + 1, CONFIRM)):
        if observer.ring[(position + ahead) & _MASK].needle_lift > threshold:
            return False
    return not opens_at(observer, position)


@njit(cache=True, nogil=True)
def area_at(observer: Observer, position: int) -> float:
    """Normalised seat area of an open needle, from the raw lift."""
    c = observer.constants.coefficients
    lift = observer.ring[position & _MASK].needle_lift
    return float(seat_area(lift, c.seat_diameter, c.half_cone_angle) / c.area_scale)


@njit(cache=True, nogil=True)
def shut_area(observer: Observer, position: int) -> float:
    """Normalised seat area of a closed needle: 0, or beside an opening the negative area its ramp comes from.

    The ramp of the two samples beyond is extrapolated, so that an area linear between samples reaches 0 where the
    needle leaves or meets its seat, and not at the sample before or after.
    """
    virtual = 0.0
    ahead = known(observer, position)
    if ahead >= 2 and opens_within(observer, position + 1, ahead - 1):
        first = area_at(observer, position + 1)
        virtual = 2.0 * first - area_at(observer, position + 2)
    elif position >= observer.memory[0].segment_start + 2:
        last = observer.ring[(position - 1) & _MASK].seat_area
        before = observer.ring[(position - 2) & _MASK].seat_area
        if last > 0.0:
            virtual = 2.0 * last - before
    return min(virtual, 0.0)
