"""From measured lift to seat area: stated lags undone, dead band with hysteresis, look-back to the foot of the ramp.

A lift recorded too low (`lift_offset` > 0) does not show the lowest part of a ramp, its toe: there the ramp is
extended to where the needle leaves or meets its seat. So it is in the first and the last sample of a lift that are
means, for they hold only a part of a ramp.

Stated lags are undone sample by sample. A rail pressure that is late is taken from later samples, on a straight line
between two. A lift y whose sensor has the time constant tau is y + tau y', by central differences: they leave ramps
as straight as they are, and what they take from one sample beside a corner they give to the next.
"""

import math

from observer_rt.foundation.compiled import compiled, inlined, inner, inner_separate
from observer_rt.foundation.continuity import RECORDED_RING
from observer_rt.model.effective import InputTerms
from observer_rt.model.hydraulics import normalised_area
from observer_rt.observer.stream.state import LIFT, RAIL, RING, Observer, Undoing

LOOK_BACK = 3  # samples before the crossing of the dead band whose raw lift counts
DEAD_BAND_SIGMAS = 5.0
DEAD_BAND_FLOOR = 2.0e-6  # m
CONFIRM = 2  # consecutive samples that shut the needle
OPENING = 40e-6  # s above the dead band that open it: less is a spike
FEWEST_OPENING, MOST_OPENING = 2, 8  # samples of that
FOOT = 0.3  # of the dead band, above which these samples are the foot of a ramp
RAMP = 30e-6  # s of a ramp from which its slope is taken, behind its first sample
LONGEST_RAMP = LOOK_BACK + FEWEST_OPENING - 2  # samples; so many are known when the slope is needed
SLOWEST_OPENING = 0.3  # m/s
LOWEST = 15e-6  # m, below which a needle does not stop when it opens
STEPPED = 30e-6  # m, below which one that does is likely none: its sensor has stepped
LEAPS = 3  # quicker than a needle, within the look-ahead, by which a lift is none: a spike has two
OFF_SEAT = (
    40e-6  # m, by which a lift may leap from its seat: where its sensor's offset is not that of the seat
)
_MASK = RING - 1


@compiled
def dead_band(lift_noise: float) -> tuple[float, float]:
    """Lift [m] above which the needle is open and below which it is shut again, from the lift noise [m]."""
    opens = max(DEAD_BAND_FLOOR, DEAD_BAND_SIGMAS * lift_noise)
    return opens, 0.5 * opens


def toe_samples(inputs: InputTerms, interval: float) -> int:
    """Most samples of an opening ramp that the recorded lift does not show; sample interval [s]."""
    return math.ceil(max(inputs.lift_shift, 0.0) / (SLOWEST_OPENING * interval))


def confirming_samples(interval: float) -> int:
    """Samples in a row above the dead band that open the needle; sample interval [s]."""
    return min(max(round(OPENING / interval), FEWEST_OPENING), MOST_OPENING)


def samples_ahead(interval: float) -> int:
    """Samples the front end must know beyond the first recorded as open; sample interval [s]."""
    return LOOK_BACK + confirming_samples(interval) - 1


def ramp_samples(interval: float) -> int:
    """Samples behind the first of a ramp from which its slope is taken; sample interval [s]."""
    return min(max(round(RAMP / interval), 1), LONGEST_RAMP)


@inner
def known(observer: Observer, position: int) -> int:
    """How many samples after `position` are received and follow it without a break (at most the look-ahead)."""
    memory = observer.memory[0]
    count = min(memory.received - 1 - position, observer.constants.timing.lookahead)
    if memory.newest_break <= position:
        return int(count)
    for ahead in range(count):
        if observer.ring[(position + ahead + 1) & _MASK].broken != 0:
            return ahead
    return int(count)


@inner
def opens_at(observer: Observer, position: int) -> bool:
    """Whether the needle counts as open from `position` on: it is recorded so, or its ramp begins before."""
    foot: int = _foot_ahead(observer, position, 0)
    if foot <= 0:
        return foot == 0
    return bool(_ramp_lift(observer, position, foot) > 0.0)


@inner
def open_from(observer: Observer, position: int) -> None:
    """Note the ramp of a needle that opens at `position`: where it is first recorded, and how it gets there."""
    memory = observer.memory[0]
    foot = max(_foot_ahead(observer, position, 0), 0)
    memory.foot = position + foot
    memory.rise = _rise(observer, position + foot, known(observer, position) - foot)
    memory.foot_lift = _lift_before_foot(observer, position + foot, memory.rise)
    memory.fall = 0.0


@inner_separate
def _foot_ahead(observer: Observer, position: int, nearest: int) -> int:
    """Samples from `position` to the first recorded as open, from `nearest` to a toe beyond; -1 if there is none.

    One more where that is a mean over a part of the ramp only.
    """
    ahead = known(observer, position)
    for distance in range(nearest, min(nearest + observer.constants.timing.toe, ahead) + 1):
        if _opens_within(observer, position + distance, min(ahead - distance, _reach(observer))):
            return int(distance + _is_partial(observer, position + distance))
    return -1


@inner
def _is_partial(observer: Observer, position: int) -> int:
    """1 where a ramp begins within the mean that `position`, recorded as open, is; else 0."""
    if not observer.constants.means:
        return 0
    is_first = position <= observer.memory[0].segment_start
    return int(is_first or not _opens_within(observer, position - 1, _reach(observer)))


@inlined
def _reach(observer: Observer) -> int:
    """`samples_ahead`."""
    return int(LOOK_BACK + observer.constants.timing.confirm - 1)


@inner
def _opens_within(observer: Observer, position: int, samples: int) -> bool:
    """Whether `position` is recorded as open: it crosses the dead band there, or within the next `samples`.

    Up to LOOK_BACK samples before the crossing belong to the opening while they stand out of the noise.
    """
    threshold = observer.memory[0].lift_on
    run = 0
    for ahead in range(samples + 1):
        lift = observer.ring[(position + ahead) & _MASK].lift
        if lift > threshold:
            run += 1
            if run == observer.constants.timing.confirm:
                return True
        elif run > 0 or lift < FOOT * threshold:
            return False
    return False


@inner_separate
def stays_low(observer: Observer, position: int, highest: float) -> bool:
    """Whether a needle long at rest that is recorded as open from `position` on does not rise on.

    highest: [m], below which that is looked at. Then its zero has stepped: no needle stops just off its seat. (Asked
    for at an opening only, for calls cost much.)
    """
    memory = observer.memory[0]
    timing = observer.constants.timing
    ring = observer.ring
    if ring[position & _MASK].index - memory.shut_since <= timing.bounce:
        return False
    ahead = known(observer, position)
    first = 0
    while first < ahead and not ring[(position + first) & _MASK].lift > memory.lift_on:
        first += 1
    last = min(first + timing.confirm - 1, ahead)
    half = (last - first + 1) // 2
    if half == 0:
        return False
    earlier, later = 0.0, 0.0
    for k in range(half):
        earlier += ring[(position + first + k) & _MASK].lift / half
        later += ring[(position + last - k) & _MASK].lift / half
    slowest = 0.5 * SLOWEST_OPENING * observer.constants.interval * half
    return bool(later - earlier < min(memory.lift_on, slowest) and 0.5 * (earlier + later) < highest)


@inner_separate
def leaps_about(observer: Observer, position: int) -> bool:
    """Whether the lift that opens at `position` is no needle's: noise in another unit, a loose connection."""
    memory, ring = observer.memory[0], observer.ring
    quickest = observer.constants.quickest + memory.lift_on + OFF_SEAT
    leaps = 0
    for k in range(position, position + known(observer, position) + 1):
        leaps += abs(ring[k & _MASK].lift - ring[(k - 1) & _MASK].lift) > quickest
    return bool(leaps >= LEAPS)


@inner
def _recorded_lift(observer: Observer, position: int) -> float:
    """True lift [m] of an open needle, from the recorded one."""
    inputs = observer.constants.inputs
    return float(inputs.lift_factor * observer.ring[position & _MASK].lift + inputs.lift_shift)


@compiled
def slope_of_means(partial: float, full: float, slope: float, tolerance: float) -> float:
    """Slope [m a sample] of a straight ramp from 0, of lifts [m] that are means.

    partial: over the period in which the ramp begins; full: over the next one; slope: from there on, which is the
    ramp's unless that ends too soon: then `partial` would be larger, by more than `tolerance`.
    """
    if full <= 0.0:
        return max(slope, 0.0)
    if slope > 0.0:
        share = max(full / slope - 0.5, 0.0)  # of the period in which the ramp begins
        if 0.5 * slope * share * share <= partial + tolerance:
            return slope
    ratio = max(partial, 0.0) / full
    return full / (ratio + math.sqrt(ratio * ratio + ratio) + 0.5)


@inner_separate
def _slope_of_means(observer: Observer, outermost: int, inwards: int, slope: float) -> float:
    """The same of the ramp whose outermost sample is `outermost`, the next one `inwards` (1 or -1) of it."""
    factor = observer.constants.inputs.lift_factor
    partial = factor * observer.ring[outermost & _MASK].lift
    full = factor * observer.ring[(outermost + inwards) & _MASK].lift
    return float(slope_of_means(partial, full, slope, observer.memory[0].lift_off))


@inner
def _rise(observer: Observer, foot: int, ahead: int) -> float:
    """Slope [m a sample] of the ramp whose first recorded sample is at `foot`; its first interval may be cut."""
    length = min(observer.constants.timing.ramp, ahead)
    first = 1 if length > 1 else 0
    if length == 0:
        return 0.0
    rise = _recorded_lift(observer, foot + length) - _recorded_lift(observer, foot + first)
    rise = max(rise / (length - first), 0.0)
    if observer.constants.means:
        return float(_slope_of_means(observer, foot - 1, 1, rise))
    return float(rise)


@inner
def _lift_before_foot(observer: Observer, foot: int, rise: float) -> float:
    """Lift [m] a sample before the first recorded one: above the shift of the lift it would have been recorded.

    Of means it was, and does not count.
    """
    if observer.constants.means:
        return float(_recorded_lift(observer, foot) - rise)
    return float(min(_recorded_lift(observer, foot) - rise, observer.constants.inputs.lift_shift))


@inner
def _ramp_lift(observer: Observer, position: int, foot: int) -> float:
    """Lift [m] at `position`, `foot` samples before the first recorded as open (0: the recorded one)."""
    if foot <= 0:
        return float(_recorded_lift(observer, position))
    rise = _rise(observer, position + foot, known(observer, position) - foot)
    if rise == 0.0:
        return 0.0
    return float(_lift_before_foot(observer, position + foot, rise) - (foot - 1) * rise)


@inner
def is_recorded_shut(observer: Observer, position: int) -> bool:
    """Whether an open needle is recorded as shut from `position` on (not while the ramp is still to come)."""
    if position < observer.memory[0].foot:
        return False
    if observer.constants.means and _ends_within(observer, position):
        return bool(_lift_before_end(observer, position) <= 0.0)
    return bool(_no_lift_from(observer, position))


@inner
def _no_lift_from(observer: Observer, position: int) -> bool:
    """Whether the lift of an open needle is within the dead band from `position` on."""
    memory = observer.memory[0]
    # a ramp whose toe is missing ends at once: what is below the dead band is noise
    threshold = memory.lift_on if observer.constants.timing.toe > 0 else memory.lift_off
    ahead = known(observer, position)
    for distance in range(min(ahead + 1, CONFIRM)):
        if observer.ring[(position + distance) & _MASK].lift > threshold:
            return False
    return not _opens_within(observer, position, min(ahead, _reach(observer)))


@inner
def _ends_within(observer: Observer, position: int) -> bool:
    """Whether a ramp ends within the mean that `position` is, and samples before it tell that ramp."""
    return bool(
        position - 1 >= observer.memory[0].foot
        and known(observer, position) > 0
        and not _no_lift_from(observer, position)
        and _no_lift_from(observer, position + 1)
    )


@inner
def _lift_before_end(observer: Observer, position: int) -> float:
    """Lift [m] at `position` on the ramp that ends within it."""
    last, before = _recorded_lift(observer, position - 1), _recorded_lift(observer, position - 2)
    return float(last - _slope_of_means(observer, position, -1, before - last))


@inner
def keep_sinking(observer: Observer, position: int) -> bool:
    """Whether a needle recorded as shut has still to sink to its seat; moves it down its ramp by a sample."""
    memory = observer.memory[0]
    timing = observer.constants.timing
    if timing.toe == 0:
        return False
    if memory.fall > 0.0:
        memory.sinking_lift -= memory.fall
    else:
        beyond = 2 if observer.constants.means else 1
        last = position - beyond  # its interval may be cut, as at the foot of the opening
        length = min(timing.ramp, last - max(memory.event_opening, memory.foot))
        final = 1 if length > 1 else 0
        if length > 0:
            fall = _recorded_lift(observer, last - length) - _recorded_lift(observer, last - final)
            memory.fall = max(fall / (length - final), 0.0)
        highest = max(_recorded_lift(observer, position), observer.constants.inputs.lift_shift)
        memory.sinking_lift = min(_recorded_lift(observer, last) - beyond * memory.fall, highest)
    if memory.fall == 0.0 or memory.sinking_lift <= 0.0:
        memory.fall = 0.0
        return False
    return True


@inner
def area_at(observer: Observer, position: int) -> float:
    """Normalised seat area of an open needle."""
    memory = observer.memory[0]
    if position < memory.foot:
        lift = memory.foot_lift - (memory.foot - 1 - position) * memory.rise
    elif memory.fall > 0.0:
        lift = memory.sinking_lift
    elif observer.constants.means and _ends_within(observer, position):
        lift = _lift_before_end(observer, position)
    else:
        lift = _recorded_lift(observer, position)
    return float(normalised_area(lift, observer.constants.coefficients.seat))


@inner
def shut_area(observer: Observer, position: int) -> float:
    """Normalised seat area of a closed needle: 0, or beside an opening the negative area its ramp comes from.

    The ramp of the two samples beyond is extrapolated, so that an area linear between samples reaches 0 where the
    needle leaves or meets its seat, and not at the sample before or after.
    """
    virtual = 0.0
    seat = observer.constants.coefficients.seat
    foot = _foot_ahead(observer, position, 1) if known(observer, position) >= 2 else -1
    if foot > 0:
        first = _ramp_lift(observer, position + 1, foot - 1)
        if first > 0.0 or foot == 1:
            second = _ramp_lift(observer, position + 2, foot - 2)
            virtual = 2.0 * normalised_area(first, seat) - normalised_area(second, seat)
    elif position >= observer.memory[0].segment_start + 2:
        last = observer.ring[(position - 1) & _MASK].lift_area
        before = observer.ring[(position - 2) & _MASK].lift_area
        if last > 0.0:
            virtual = 2.0 * last - before
    return min(virtual, 0.0)


@inner
def area_between_lifts(observer: Observer, position: int) -> float:
    """Normalised seat area at the time of a sample, on the straight line between two areas where the lift was taken.

    So the corners of the ramps stay where they were recorded; the lift itself, brought to the times of the samples,
    would lose them.
    """
    row = observer.ring[position & _MASK]
    if row.lift_after == 0.0 or position == observer.memory[0].segment_start:
        return float(row.lift_area)
    before = observer.ring[(position - 1) & _MASK]
    since = 1.0 - before.lift_after
    return float(before.lift_area + (row.lift_area - before.lift_area) * since / (since + row.lift_after))


_RECORDED_MASK = RECORDED_RING - 1


def undoing_of(inputs: InputTerms, interval: float) -> Undoing:
    """What there is to undo at a sample interval [s]."""
    late = inputs.rail_delay / interval
    whole = math.floor(late)
    ahead = max(math.ceil(late), int(inputs.lift_lag > 0.0), 0)
    stated = inputs.rail_delay != 0.0 or inputs.lift_lag != 0.0
    return Undoing(stated, whole, late - whole, inputs.lift_lag / interval, ahead)


def noise_gain(lag: float) -> float:
    """By what the white noise of a lift is multiplied where a lag of its sensor [samples] is undone."""
    return math.sqrt(1.0 + 0.5 * lag**2)  # of central differences


@inner
def true_rail_pressure(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [Pa]; at the ends of a stretch that of its first or last sample."""
    memory = observer.memory[0]
    undoing = observer.constants.undoing
    last = memory.recorded - 1
    earlier = min(max(number + undoing.rail_late, memory.unbroken_since), last)
    later = min(max(number + undoing.rail_late + 1, memory.unbroken_since), last)
    start = observer.recorded[earlier & _RECORDED_MASK].values[RAIL]
    end = observer.recorded[later & _RECORDED_MASK].values[RAIL]
    return float(start + undoing.rail_fraction * (end - start))


@inner
def true_lift(observer: Observer, number: int) -> float:
    """Of the `number`-th sample [m]; at the ends of a stretch from the one neighbour it has."""
    memory = observer.memory[0]
    before = max(number - 1, memory.unbroken_since)
    after = min(number + 1, memory.recorded - 1)
    lift = observer.recorded[number & _RECORDED_MASK].values[LIFT]
    if after == before:
        return float(lift)
    rise = (
        observer.recorded[after & _RECORDED_MASK].values[LIFT]
        - observer.recorded[before & _RECORDED_MASK].values[LIFT]
    )
    return float(lift + observer.constants.undoing.lift_lag * rise / (after - before))
