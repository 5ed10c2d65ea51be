# Decides validity, here only: state and reason of a sample, an injection or the service.
#
# What is valid has no reason. docs/validity.md says who knows what, and when.

from libc.stdint cimport int64_t

from observer_rt.core.stream.state cimport (
    DOUBT_NONE, STATE_ADAPTED, STATE_DEGRADED, STATE_RUNNING_NOMINAL, STATE_STARTING
)

cdef enum:  # OwnReason: the reasons that the core finds
    REASON_NONE = 0
    REASON_STARTING = 1
    REASON_JUMPED = 2
    REASON_NUMERICAL = 5
    REASON_NEEDLE_STUCK = 6
    REASON_TOO_FEW_EVENTS = 7
    REASON_INPUT_STALE = 18
    REASON_NOT_JUDGED = 19
    REASON_CONTRADICTED = 20
    REASON_NO_STANDSTILL = 22
    REASON_LIFT_ZERO = 23
    REASON_OUTSIDE_LEARNED_RANGE = 28
    REASON_LIFT_DEAD = 29
    REASON_PRELIMINARY = 30


cdef struct SampleFacts:
    # What the stream knows at a sample; reasons are 0 where there is none.
    int64_t unsynchronised_by  # Reason since which x~ has not settled
    bint is_synchronised
    int64_t doubt  # Doubt of the sample itself
    int64_t input_fault  # Reason all samples are not to be trusted now
    bint is_lift_beyond  # the zero of the lift has gone too far
    bint is_lift_dead  # it does not show what the line pressure does
    int64_t events  # judged, and of samples to be trusted
    int64_t events_required
    bint is_in_learned_range  # the flow is known well enough for such an injection
    int64_t judgement  # Reason the last judged event did not pass
    bint is_contradicted  # by the innovations since, or by how the needle opened
    bint has_learned  # something is in force
    bint is_preliminary  # the needle may move, and its lift is not recorded


cdef inline int64_t reason_of_sample(const SampleFacts* facts) noexcept nogil:
    """Why the sample is not valid (Reason), the first that holds; 0: it is."""
    if not facts.is_synchronised:
        return facts.unsynchronised_by
    if facts.doubt != DOUBT_NONE:
        return facts.doubt
    if facts.input_fault != REASON_NONE:
        return facts.input_fault
    if facts.is_lift_beyond:
        return REASON_LIFT_ZERO
    if facts.is_lift_dead:
        return REASON_LIFT_DEAD
    if facts.judgement != REASON_NONE:
        return facts.judgement
    if facts.events < facts.events_required:
        return REASON_TOO_FEW_EVENTS
    if facts.is_contradicted:
        return REASON_CONTRADICTED
    if not facts.is_in_learned_range:
        return REASON_OUTSIDE_LEARNED_RANGE
    if facts.is_preliminary:
        return REASON_PRELIMINARY
    return facts.unsynchronised_by


cdef inline int64_t state_of_sample(const SampleFacts* facts, int64_t reason) noexcept nogil:
    """The State at the sample with this reason: faults degrade it, missing knowledge does not."""
    cdef bint is_unsynchronised, is_doubted
    if facts.unsynchronised_by == REASON_STARTING:
        return STATE_STARTING
    is_unsynchronised = facts.unsynchronised_by != REASON_NONE and facts.unsynchronised_by != REASON_JUMPED
    is_doubted = facts.doubt != DOUBT_NONE or facts.input_fault != REASON_NONE or facts.judgement != REASON_NONE
    if is_unsynchronised or is_doubted or reason in (REASON_CONTRADICTED, REASON_LIFT_ZERO, REASON_LIFT_DEAD):
        return STATE_DEGRADED
    return STATE_ADAPTED if facts.has_learned else STATE_RUNNING_NOMINAL
