"""The needle as it answers commands: strokes, lifts, and the seat areas of a window with their slopes."""

from libc.stdint cimport int64_t

from numpy import zeros

from observer_rt.core.model.hydraulics cimport Seat, normalised_area, normalised_area_slope
from observer_rt.core.model.needle cimport *
from observer_rt.core.records import tuple_of

cdef double[10] _blank  # room for either struct
globals().update(
    CORNER_ROUNDING=CORNER_ROUNDING,
    NEEDLE_JITTER=NEEDLE_JITTER,
    NEEDLE_NUMBERS=NEEDLE_NUMBERS,
    NeedleLaw=tuple_of(__name__, "NeedleLaw", (<NeedleLaw*> _blank)[0]),
    NeedleStroke=tuple_of(__name__, "NeedleStroke", (<NeedleStroke*> _blank)[0]),
)

NOTHING_LEARNED = zeros(NEEDLE_NUMBERS)


def stroke_of(double start, double length, double pressure, needle, learned=NOTHING_LEARNED) -> dict[str, float] | None:
    """Stroke of a `NeedleLaw` and its learned numbers for a command [s], at a pressure over 100 MPa, or None."""
    cdef NeedleLaw of_needle = needle._asdict()
    cdef const double[::1] numbers = learned
    cdef NeedleStroke s
    if numbers.shape[0] != NEEDLE_NUMBERS:
        raise ValueError("numbers learned of a needle do not fit")
    return s if answers(start, length, pressure, &of_needle, &numbers[0], &s) else None


def lift_of_stroke(double time, stroke) -> float:
    """Lift [m] at `time` [s] of a `schedule.Stroke` with rounded corners; exactly 0 outside the stroke."""
    cdef NeedleStroke s = stroke._asdict()
    return rounded_lift(time, CORNER_ROUNDING, &s)


def commanded_areas(
    const double[:, :] commands, const double[:] pressures, needle, const double[::1] learned, seat, double interval,
    double[::1] areas, double[:, ::1] slopes, int64_t[::1] shots
) -> None:
    """Normalised seat areas (n,) at samples, by commands (k, 2) as of `Window`, and their slopes (n, NEEDLE_NUMBERS).

    pressures (k,): of the rail at each command, over 100 MPa; learned (NEEDLE_NUMBERS,); areas, slopes: 0 at first;
    shots (n,): numbers of the commands that open the needle. A needle that does not bounce has slopes by a bounce.
    """
    cdef NeedleLaw of_needle = needle._asdict()
    cdef Seat of_seat = seat._asdict()
    cdef NeedleStroke s
    cdef double[NEEDLE_NUMBERS] by_number
    cdef double window = max(CORNER_ROUNDING, 2.0 * interval), time, lift, area, steep, start, end
    cdef int64_t command, k, number, n = areas.shape[0]
    if learned.shape[0] != NEEDLE_NUMBERS or shots.shape[0] < n or slopes.shape[0] < n or slopes.shape[1] != NEEDLE_NUMBERS:
        raise ValueError("arrays of a needle do not fit each other")
    with nogil:
        for command in range(commands.shape[0]):
            start, end = commands[command, 0] * interval, commands[command, 1] * interval
            if not answers(start, end - start, pressures[command], &of_needle, &learned[0], &s):
                continue
            for k in range(max(<int64_t> ((s.opening - window) / interval), 0), n):
                time = k * interval
                if time >= s.landed + 0.5 * window:
                    break
                lift = rounded_lift(time, window, &s)
                lift_slopes(time, window, &s, by_number)
                area = normalised_area(lift, &of_seat)
                if area < areas[k] or lift <= 0.0 and by_number[BOUNCE_HEIGHT] <= 0.0:
                    continue
                areas[k], shots[k] = area, command
                steep = normalised_area_slope(lift, &of_seat)
                for number in range(<int64_t> NEEDLE_NUMBERS):
                    slopes[k, number] = steep * by_number[number]
