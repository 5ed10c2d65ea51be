/* From the recorded lift to the seat area. */
#include "front_end.h"

#include "model.h"

#define FOOT R(0.3) /* of the dead band, above which samples before the crossing are the foot of a ramp */

static real_t recorded(const FrontEnd *f, uint32_t number)
{
    return LIFT_FACTOR * f->lift[number & LIFT_RING_MASK] + LIFT_SHIFT;
}

/* Whether `number` is recorded as open: it crosses the dead band there, or within the next samples. */
static bool opens_within(const FrontEnd *f, uint32_t number, uint32_t samples)
{
    bool opens = false;
    bool decided = false;
    uint32_t run = 0U;
    for (uint32_t ahead = 0U; (ahead <= samples) && !decided; ++ahead) {
        const real_t lift = f->lift[(number + ahead) & LIFT_RING_MASK];
        if (lift > OPENS_ABOVE) {
            run += 1U;
            opens = run == CONFIRM_OPEN;
            decided = opens;
        } else {
            decided = (run > 0U) || (lift < FOOT * OPENS_ABOVE);
        }
    }
    return opens;
}

static uint32_t within_reach(uint32_t ahead)
{
    return (ahead < REACH) ? ahead : REACH;
}

static uint32_t within_ramp(uint32_t length)
{
    return (length < RAMP) ? length : RAMP;
}

/* Samples to the first recorded as open, from `nearest` to a toe beyond; -1 if there is none. */
static int32_t foot_ahead(const FrontEnd *f, uint32_t number, uint32_t nearest)
{
    int32_t found = -1;
    for (uint32_t distance = nearest; (distance <= nearest + TOE) && (distance <= LOOKAHEAD) && (found < 0);
         ++distance) {
        if (opens_within(f, number + distance, within_reach(LOOKAHEAD - distance))) {
            found = (int32_t)distance;
        }
    }
    return found;
}

/* Slope [m a sample] of the ramp whose first recorded sample is at `foot`, with so many samples known beyond it. */
static real_t rise_from(const FrontEnd *f, uint32_t foot, uint32_t ahead)
{
    const uint32_t length = within_ramp(ahead);
    const uint32_t first = (length > 1U) ? 1U : 0U;
    real_t rise = R(0.0);
    if (length > 0U) {
        rise = recorded(f, foot + length) - recorded(f, foot + first);
        rise = r_max(rise / (real_t)(length - first), R(0.0));
    }
    return rise;
}

static real_t before_foot(const FrontEnd *f, uint32_t foot, real_t rise)
{
    return r_min(recorded(f, foot) - rise, LIFT_SHIFT);
}

/* Lift [m] at `number`, `foot` samples before the first recorded as open. */
static real_t ramp_lift(const FrontEnd *f, uint32_t number, uint32_t foot)
{
    real_t lift;
    if (foot == 0U) {
        lift = recorded(f, number);
    } else {
        const real_t rise = rise_from(f, number + foot, LOOKAHEAD - foot);
        lift = (rise == R(0.0)) ? R(0.0)
                                : (before_foot(f, number + foot, rise) - (real_t)(foot - 1U) * rise);
    }
    return lift;
}

/* Whether a needle long at rest that is recorded as open does not rise on: then its lift has stepped. */
static bool stays_low(const FrontEnd *f, uint32_t number)
{
    bool stays = false;
    if (f->shut_for > BOUNCE) {
        uint32_t first = 0U;
        while ((first < LOOKAHEAD) && !(f->lift[(number + first) & LIFT_RING_MASK] > OPENS_ABOVE)) {
            first += 1U;
        }
        const uint32_t end = first + CONFIRM_OPEN - 1U;
        const uint32_t last = (end < LOOKAHEAD) ? end : LOOKAHEAD;
        const uint32_t half = (last + 1U - first) / 2U;
        if (half > 0U) {
            const real_t count = (real_t)half;
            real_t earlier = R(0.0);
            real_t later = R(0.0);
            for (uint32_t k = 0U; k < half; ++k) {
                earlier += f->lift[(number + first + k) & LIFT_RING_MASK] / count;
                later += f->lift[(number + last - k) & LIFT_RING_MASK] / count;
            }
            const real_t slowest = R(0.5) * SLOWEST_OPENING * SAMPLE_INTERVAL * count;
            stays = ((later - earlier) < r_min(OPENS_ABOVE, slowest)) &&
                    (R(0.5) * (earlier + later) < LOWEST_LIFT);
        }
    }
    return stays;
}

static bool opens_at(const FrontEnd *f, uint32_t number)
{
    const int32_t foot = foot_ahead(f, number, 0U);
    bool opens = foot == 0;
    if (foot > 0) {
        opens = ramp_lift(f, number, (uint32_t)foot) > R(0.0);
    }
    return opens && !stays_low(f, number);
}

static void open_from(FrontEnd *f, uint32_t number)
{
    const int32_t foot = foot_ahead(f, number, 0U);
    const uint32_t ahead = (foot > 0) ? (uint32_t)foot : 0U;
    f->is_open = true;
    f->open_for = 0U;
    f->foot = number + ahead;
    f->rise = rise_from(f, f->foot, LOOKAHEAD - ahead);
    f->foot_lift = before_foot(f, f->foot, f->rise);
    f->fall = R(0.0);
}

/* Whether a sample lies before the foot of the opening ramp. */
static bool is_before_foot(const FrontEnd *f, uint32_t number)
{
    return (f->open_for <= LOOKAHEAD) && ((int32_t)(f->foot - number) > 0);
}

static bool is_recorded_shut(const FrontEnd *f, uint32_t number)
{
    const real_t threshold = (TOE > 0U) ? OPENS_ABOVE : SHUTS_BELOW;
    bool is_shut = !is_before_foot(f, number);
    for (uint32_t ahead = 0U; (ahead < CONFIRM_SHUT) && (ahead <= LOOKAHEAD) && is_shut; ++ahead) {
        is_shut = !(f->lift[(number + ahead) & LIFT_RING_MASK] > threshold);
    }
    return is_shut && !opens_within(f, number, within_reach(LOOKAHEAD));
}

/* Whether a needle recorded as shut has still to sink to its seat; moves it down its ramp by a sample. */
static bool keeps_sinking(FrontEnd *f, uint32_t number)
{
    if (TOE > 0U) {
        if (f->fall > R(0.0)) {
            f->sinking_lift -= f->fall;
        } else {
            const uint32_t last = number - 1U;
            const uint32_t length = ((int32_t)(last - f->foot) < 0) ? 0U : within_ramp(last - f->foot);
            const uint32_t final = (length > 1U) ? 1U : 0U;
            if (length > 0U) {
                const real_t fall = recorded(f, last - length) - recorded(f, last - final);
                f->fall = r_max(fall / (real_t)(length - final), R(0.0));
            }
            f->sinking_lift =
                r_min(recorded(f, last) - f->fall, r_max(recorded(f, number), LIFT_SHIFT));
        }
        if ((f->fall == R(0.0)) || (f->sinking_lift <= R(0.0))) {
            f->fall = R(0.0);
        }
    }
    return f->fall > R(0.0);
}

static real_t open_seat(const FrontEnd *f, uint32_t number)
{
    real_t lift;
    if (is_before_foot(f, number)) {
        lift = f->foot_lift - (real_t)(f->foot - 1U - number) * f->rise;
    } else if (f->fall > R(0.0)) {
        lift = f->sinking_lift;
    } else {
        lift = recorded(f, number);
    }
    return inj_seat_opened(lift);
}

/* 0, or the negative area from which a ramp comes or to which it leads, by the two samples beyond. */
static real_t shut_seat(const FrontEnd *f, uint32_t number)
{
    real_t area = R(0.0);
    const int32_t foot = foot_ahead(f, number, 1U);
    if (foot > 0) {
        const uint32_t ahead = (uint32_t)foot;
        const real_t first = ramp_lift(f, number + 1U, ahead - 1U);
        if ((first > R(0.0)) || (ahead == 1U)) {
            const real_t second = (ahead == 1U) ? recorded(f, number + 2U) : ramp_lift(f, number + 2U, ahead - 2U);
            area = R(2.0) * inj_seat_opened(first) - inj_seat_opened(second);
        }
    } else if (f->area_before[0] > R(0.0)) {
        area = R(2.0) * f->area_before[0] - f->area_before[1];
    } else {
        /* shut for long */
    }
    return r_min(area, R(0.0));
}

void inj_front_end_init(FrontEnd *f)
{
    for (uint32_t i = 0U; i < LIFT_RING; ++i) {
        f->lift[i] = R(0.0);
    }
    f->is_open = false;
    f->shut_for = 0U;
    f->open_for = 0U;
    f->foot = 0U;
    f->rise = R(0.0);
    f->foot_lift = R(0.0);
    f->fall = R(0.0);
    f->sinking_lift = R(0.0);
    f->area_before[0] = R(0.0);
    f->area_before[1] = R(0.0);
}

real_t inj_front_end_area(FrontEnd *f, uint32_t number)
{
    real_t area;
    if (!f->is_open) {
        if (opens_at(f, number)) {
            open_from(f, number);
        }
    } else if (!is_recorded_shut(f, number)) {
        f->fall = R(0.0);
    } else if (!keeps_sinking(f, number)) {
        f->is_open = false;
        f->shut_for = 0U;
    } else {
        /* it still sinks */
    }
    if (f->is_open) {
        area = open_seat(f, number);
        f->open_for += (f->open_for < LONG_AGO) ? 1U : 0U;
    } else {
        area = shut_seat(f, number);
        f->shut_for += (f->shut_for < LONG_AGO) ? 1U : 0U;
    }
    f->area_before[1] = f->area_before[0];
    f->area_before[0] = area;
    return area;
}
