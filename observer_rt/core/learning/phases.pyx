"""Phases of an event, sample by sample, and sums of the innovations in each."""

from libc.stdint cimport int8_t, int64_t

from numpy import empty, zeros

cdef enum:  # engine.estimation.phases.Phase
    STANDSTILL, OPENING, OPEN, CLOSING, AFTER

globals().update(STANDSTILL=STANDSTILL, OPENING=OPENING, OPEN=OPEN, CLOSING=CLOSING, AFTER=AFTER)


def phases_of(window, int64_t edge, int64_t afterglow) -> NDArray[np.int8]:
    """`Phase` of every sample of a window (n,); edge and afterglow in samples.

    An opening shorter than two edges is all opening in its first half and all closing in its second.
    """
    cdef const double[:, :] inputs = window.inputs
    cdef const unsigned char[:] resting = window.resting.view("u1")
    cdef int64_t n = inputs.shape[0], opening = window.opening, shut_index = -n, k = 0, end, i, from_start, to_end
    phases = empty(n, "i1")
    cdef int8_t[::1] result = phases
    if len(window.output) != n or resting.shape[0] != n:
        raise ValueError("arrays of a window do not fit each other")
    with nogil:
        while k < n:
            if inputs[k, 1] > 0.0:
                end = k
                while end < n and inputs[end, 1] > 0.0:
                    end += 1
                for i in range(k, end):
                    from_start, to_end = i - k, end - 1 - i
                    if from_start < edge and from_start <= to_end:
                        result[i] = OPENING
                    elif to_end < edge:
                        result[i] = CLOSING
                    else:
                        result[i] = OPEN
                shut_index = end
                k = end
                continue
            if k - shut_index < afterglow:
                result[k] = CLOSING
            elif resting[k] or k < opening:
                result[k] = STANDSTILL
            else:
                result[k] = AFTER
            k += 1
    return phases


def sum_innovations(
    const double[:] innovations,
    double sigma,
    double limit,
    const int8_t[:] phases,
    left_out,
    const int64_t[::1] lengths,
    double[:] squares,
    double[:] samples,
    double[:, :] block_squares,
    double[:, :] blocks,
) -> None:
    """Add squares of innovations (n,) over sigma by phase, clipped to `limit` sigma, and of means of blocks (k,)."""
    cdef const unsigned char[:] is_left_out = left_out.view("u1")
    cdef double[::1] totals = zeros(lengths.shape[0])
    cdef int64_t[::1] counts = zeros(lengths.shape[0], "i8")
    cdef int64_t before = -1, phase, k, i  # before: phase of the sample before, of those that count
    cdef double z
    if phases.shape[0] != innovations.shape[0] or is_left_out.shape[0] != innovations.shape[0]:
        raise ValueError("as many phases and marks as innovations are wanted")
    with nogil:
        for k in range(innovations.shape[0]):
            if is_left_out[k]:
                continue
            phase = phases[k]
            z = min(max(innovations[k], -limit * sigma), limit * sigma) / sigma
            squares[phase] += z * z
            samples[phase] += 1.0
            for i in range(lengths.shape[0]):
                if phase != before:
                    totals[i], counts[i] = 0.0, 0
                totals[i] += z
                counts[i] += 1
                if counts[i] == lengths[i]:
                    block_squares[phase, i] += totals[i] * totals[i] / <double> counts[i]
                    blocks[phase, i] += 1.0
                    totals[i], counts[i] = 0.0, 0
            before = phase
