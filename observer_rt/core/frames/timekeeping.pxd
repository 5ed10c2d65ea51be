# Timekeeping: where on the common grid the samples of a frame lie, and how well that is known.

from libc.math cimport NAN, floor
from libc.stdint cimport int64_t

from observer_rt.core.frames.clock cimport ENOUGH_POINTS, forget, index_at, take_stamp, time_of
from observer_rt.core.frames.frame_numbers cimport COUNT_ANEW, count_frame, has_slipped, is_sure
from observer_rt.core.frames.records cimport NANOSECONDS, Timekeeping
from observer_rt.core.stream.state cimport DOUBT_NONE, DOUBT_TIME_BASE

cdef enum:  # Joining: how a message's samples are joined to the grid
    JOINING_INDEX = 0  # its index is the grid's
    JOINING_RATIO = 1  # its index counts every n-th sample of the grid
    JOINING_NEAREST = 2  # same time base, but counted: its first sample is the nearest one's, the others follow
    JOINING_CLOCK = 3  # another time base: by both clocks, between samples

cdef enum:  # Numbering: how a message's frames are numbered
    NUMBERING_INDEX = 0  # a signal with the index of the first sample
    NUMBERING_COUNTER = 1  # a signal that counts frames
    NUMBERING_E2E_COUNTER = 2  # the counter of the end-to-end protection
    NUMBERING_STAMPS = 3  # nothing but when they are received

cdef extern from *:
    """
    #define UNSURE 0.25
    """
    const double UNSURE  # samples: further from the nearest sample of the grid, the next may be the right one


cdef inline int64_t number_frame(
    const Timekeeping* keeping, int64_t message, int64_t sequence, int64_t stamp
) noexcept nogil:
    """Count a frame without an index by its counter `sequence`: the `Count`; its number is in `counts` then."""
    outcome = count_frame(&keeping.counts[message], &keeping.clocks[message], sequence, stamp)
    if outcome == COUNT_ANEW:
        forget(&keeping.clocks[message])
        keeping.shifts[message].is_known = False
    return outcome


cdef inline void note_frame(const Timekeeping* keeping, int64_t message, int64_t last, int64_t stamp) noexcept nogil:
    """Note that a frame whose last sample is `last`, by its message's index or number, came at `stamp` [ns]."""
    clock = &keeping.clocks[message]
    if not take_stamp(clock, last, stamp):
        return
    if keeping.timing[message].numbering != NUMBERING_INDEX and has_slipped(clock):
        keeping.counts[message].begun = False
        forget(clock)
    if keeping.timing[message].joining == JOINING_NEAREST:
        _find_nearest(keeping, message, last)


cdef inline void begin_anew(const Timekeeping* keeping, int64_t message) noexcept nogil:
    """Begin a new index of a message; if it is the index of the grid, every message must find its place anew."""
    forget(&keeping.clocks[message])
    keeping.shifts[message].is_known = False
    if keeping.timing[message].joining != JOINING_INDEX:
        return
    for m in range(keeping.messages):
        keeping.shifts[m].is_known = False
        if keeping.timing[m].joining == JOINING_INDEX:
            forget(&keeping.clocks[m])


cdef inline bint has_place(const Timekeeping* keeping, int64_t message) noexcept nogil:
    """Whether it is known where the message's samples lie on the grid."""
    joining = keeping.timing[message].joining
    if joining == JOINING_NEAREST:
        return keeping.shifts[message].is_known
    leading = &keeping.clocks[keeping.memory.leading]
    return joining != JOINING_CLOCK or (leading.points > 0 and keeping.clocks[message].points > 0)


cdef inline double place_of(const Timekeeping* keeping, int64_t message, int64_t index) noexcept nogil:
    """Place on the grid of the sample with `index`, by the message's own index or number."""
    timing = &keeping.timing[message]
    if timing.joining == JOINING_RATIO:
        return <double> (index * timing.steps)
    leading = keeping.memory.leading
    grid = &keeping.clocks[leading]
    sampled = time_of(&keeping.clocks[message], index, grid.first_stamp) - NANOSECONDS * timing.delay
    return index_at(grid, sampled + NANOSECONDS * keeping.timing[leading].delay, grid.first_stamp)


cdef inline double place_at(const Timekeeping* keeping, int64_t time) noexcept nogil:
    """Place on the grid of a sample taken at `time` [ns] by the clock of the stamps; nan: not known."""
    leading = keeping.memory.leading
    grid = &keeping.clocks[leading]
    if not grid.begun:
        return NAN
    sent = time - grid.first_stamp + NANOSECONDS * keeping.timing[leading].delay
    return index_at(grid, sent, grid.first_stamp)


cdef inline bint is_prompt(const Timekeeping* keeping, double tolerance) noexcept nogil:
    """Whether the latest frames of the grid came when its clock says, within `tolerance` [s]."""
    grid = &keeping.clocks[keeping.memory.leading]
    early = grid.offset + grid.drift * grid.lowest_at - grid.lowest
    return max(early, grid.latest) < NANOSECONDS * tolerance


cdef inline int64_t doubt_of(const Timekeeping* keeping) noexcept nogil:
    """`Doubt` in the times of samples that come together now."""
    if not keeping.memory.by_stamps:
        return DOUBT_NONE
    grid = &keeping.clocks[keeping.memory.leading]
    for m in range(keeping.messages):
        timing = &keeping.timing[m]
        if timing.numbering != NUMBERING_INDEX and not is_sure(&keeping.counts[m], &keeping.clocks[m]):
            return DOUBT_TIME_BASE
        if timing.joining == JOINING_NEAREST and not abs(keeping.shifts[m].off) < UNSURE:
            return DOUBT_TIME_BASE
        if timing.joining == JOINING_CLOCK:
            unknown = grid.residual + keeping.clocks[m].residual
            if not unknown <= NANOSECONDS * timing.tolerance:
                return DOUBT_TIME_BASE
    return DOUBT_NONE


cdef inline void _find_nearest(const Timekeeping* keeping, int64_t message, int64_t last) noexcept nogil:
    """Take the sample of the grid that is nearest, by the clocks, to the sample `last`."""
    shift = &keeping.shifts[message]
    leading = &keeping.clocks[keeping.memory.leading]
    if leading.points < ENOUGH_POINTS or keeping.clocks[message].points < ENOUGH_POINTS:
        return
    ahead = place_of(keeping, message, last) - last
    if not shift.is_known:
        shift.is_known = True
        shift.samples = <int64_t> floor(ahead + 0.5)
    shift.off = ahead - shift.samples
