# Pump loop: takes frames from sockets through the pipeline, sends rates back onto the bus, without Python.
#
# One turn: frames that wait, of several buses the earliest first; each through the pipeline; what it caused is sent.
# With one bus it sleeps until the frame that completes a block of rates is due, so that one wake brings several frames.
# Nothing is allocated.

from libc.stdint cimport int64_t, uint32_t, uint64_t, uint8_t
from libc.string cimport memcpy

from observer_rt.core.frames.pipeline cimport handle, proceed
from observer_rt.core.frames.records cimport (
    LONGEST_FRAME, NANOSECONDS, Arrival, ErrorFrame, OutFrame, Pipeline, Publisher, PumpBus, PumpMemory
)
from observer_rt.core.stream.state cimport Observer

cdef enum:
    BATCH = 16  # frames that one system call may bring
    SLOT_BYTES = 80  # of a frame with its stamp behind it, as a feeder gives it
    CONTROL_BYTES = 128  # room for three time stamps and a count of lost frames
    ERRORS = 64  # error frames remembered until Python has read them
    WAITING = 512  # results: some 0.15 s at 100 kHz, after which the oldest serve nobody
    WAIT_MS = 20  # longest time deaf to Python
    RETRY_MS = 1  # a full transmit queue cannot be polled for
    HEADER_BYTES = 8  # of a frame, before its data
    SPARED = 10000  # ns by which it wakes before a frame is due, for a sleep ends late by about as much
    LATENCIES = 64  # four to an octave
    SHORTEST_LATENCY = 10  # bits of those [ns] that come before them: 1 us

cdef extern from *:
    """
    #include <stdint.h>
    #define EXTENDED_KEY ((int64_t) 1 << 32)
    #define BUS_KEY ((int64_t) 1 << 33)
    #define LARGEST_LATENCY ((int64_t) 10000000000)
    static inline int observer_rt_bits(uint64_t number) { return number ? 64 - __builtin_clzll(number) : 0; }
    """
    const int64_t EXTENDED_KEY  # added to the id of a frame for its key, as by bus.can_frame.frame_key
    const int64_t BUS_KEY  # for each bus before its own
    const int64_t LARGEST_LATENCY  # ns: longer ago a frame was recorded, not received
    int observer_rt_bits(uint64_t number) noexcept nogil

cdef extern from "<time.h>" nogil:
    struct timespec:
        long tv_sec
        long tv_nsec
    int clock_gettime(int clock, timespec* now)
    int nanosleep(const timespec* length, timespec* left)
    int CLOCK_REALTIME
    int CLOCK_MONOTONIC

cdef extern from "<sys/uio.h>" nogil:
    struct iovec:
        void* iov_base
        size_t iov_len

cdef extern from "<sys/socket.h>" nogil:
    struct msghdr:
        iovec* msg_iov
        size_t msg_iovlen
        void* msg_control
        size_t msg_controllen
    struct mmsghdr:
        msghdr msg_hdr
        unsigned int msg_len
    struct cmsghdr:
        int cmsg_level
        int cmsg_type
    cmsghdr* CMSG_FIRSTHDR(msghdr* header)
    cmsghdr* CMSG_NXTHDR(msghdr* header, cmsghdr* before)
    unsigned char* CMSG_DATA(cmsghdr* message)
    int recvmmsg(int socket, mmsghdr* messages, unsigned int count, int flags, timespec* timeout)
    ssize_t send(int socket, const void* data, size_t size, int flags)
    int MSG_DONTWAIT
    int MSG_WAITFORONE
    int SOL_SOCKET
    int SO_RXQ_OVFL
    int SO_TIMESTAMPNS
    int SO_TIMESTAMPING

cdef extern from "<poll.h>" nogil:
    struct pollfd:
        int fd
        short events
        short revents
    int poll(pollfd* waited, unsigned long count, int timeout_ms)
    short POLLIN

cdef extern from "<linux/can.h>" nogil:
    unsigned int CAN_EFF_FLAG
    unsigned int CAN_RTR_FLAG
    unsigned int CAN_ERR_FLAG
    unsigned int CAN_EFF_MASK
    unsigned int CAN_SFF_MASK
    enum:
        CANFD_MTU

cdef extern from "<unistd.h>" nogil:
    ssize_t write(int descriptor, const void* data, size_t size)

cdef extern from "<errno.h>" nogil:
    int errno
    int EAGAIN
    int EINTR
    int ENOBUFS
    int ENODEV


cdef struct Pumped:
    # All memory of the pump; buffers of bus b begin at b * BATCH.
    PumpMemory* memory
    int64_t bus_count
    PumpBus* buses
    ErrorFrame* errors  # ERRORS of every bus
    int64_t arrival_count
    Arrival* arrivals
    uint8_t* waiting  # WAITING results as the kernel takes them
    pollfd* polled
    uint8_t* frames  # as the kernel gives them
    uint8_t* control
    mmsghdr* headers
    iovec* vectors


cdef inline bint run_pump(Pumped* pump, Pipeline* pipeline, int wake) noexcept nogil:
    """Pump until asked to stop, or Python must act first (True), then call again; wake: descriptor for news."""
    memory = pump.memory
    cdef bint waits = proceed(pipeline)  # with what it waited for
    cdef int64_t bus
    _send_results(pump, &pipeline.publisher)
    if waits:
        return True
    while True:
        bus = _earliest(pump)
        if bus >= 0:
            if _take_frame(pump, pipeline, bus):
                return True
            continue
        if memory.first_waiting < memory.end_waiting:
            _send_waiting(pump)
        _wake_python(pump, pipeline.observer, wake)
        if memory.is_to_stop:
            return False
        memory.turns += 1
        _sleep(pump, pipeline)
        _receive(pump)


cdef inline void _send_results(Pumped* pump, Publisher* publisher) noexcept nogil:
    """Send the frames that the publisher has ready; frames without room wait, and the oldest are given up."""
    cdef uint8_t* frame
    cdef OutFrame* row
    cdef uint32_t identifier
    cdef int64_t number
    memory, ready = pump.memory, publisher.memory
    for number in range(ready.frames):
        if memory.end_waiting - memory.first_waiting == WAITING:
            memory.first_waiting += 1
            memory.unsent += 1
        frame = pump.waiting + (memory.end_waiting % WAITING) * CANFD_MTU
        row = &publisher.out[number]
        identifier = memory.identifier
        memcpy(frame, &identifier, sizeof(identifier))
        frame[4], frame[5] = <uint8_t> row.length, <uint8_t> memory.flags
        memcpy(frame + HEADER_BYTES, row.payload, row.length)
        memory.end_waiting += 1
    ready.frames = 0
    if memory.first_waiting < memory.end_waiting:
        _send_waiting(pump)


cdef inline void _send_waiting(Pumped* pump) noexcept nogil:
    """Send in order, as far as there is room; frames that wait when the bus goes down would be old afterwards."""
    memory = pump.memory
    bus = &pump.buses[memory.bus]
    while memory.first_waiting < memory.end_waiting and bus.failure == 0:
        frame = pump.waiting + (memory.first_waiting % WAITING) * CANFD_MTU
        if send(<int> bus.fd, frame, memory.size, MSG_DONTWAIT) >= 0:
            memory.first_waiting += 1
        elif errno == EAGAIN or errno == ENOBUFS:
            return
        elif errno != EINTR:
            bus.failure = errno
    memory.unsent += memory.end_waiting - memory.first_waiting
    memory.first_waiting = memory.end_waiting


cdef inline void _sleep(Pumped* pump, Pipeline* pipeline) noexcept nogil:
    """Sleep until the frame is due that completes a block of rates, if others come before, by the last block."""
    cdef timespec length
    cdef int64_t samples, left
    memory, rates = pump.memory, pipeline.publisher.memory
    samples = rates.samples - rates.filled
    if pump.bus_count > 1 or memory.first_waiting < memory.end_waiting or not 0 < memory.brought < samples:
        return
    samples += (memory.brought - samples % memory.brought) % memory.brought
    left = <int64_t> (samples * pipeline.observer.constants.interval * NANOSECONDS)
    left = min(left, memory.brought_at + left - now(CLOCK_REALTIME), <int64_t> WAIT_MS * 1000000) - SPARED
    memory.brought = 0
    if left > 0:
        length.tv_sec, length.tv_nsec = 0, left
        nanosleep(&length, NULL)


cdef inline void _receive(Pumped* pump) noexcept nogil:
    """Wait for frames of any bus, and take those that are there."""
    cdef bint is_late = pump.memory.first_waiting < pump.memory.end_waiting
    cdef int64_t number
    if pump.bus_count == 1 and pump.buses[0].failure == 0 and not is_late:
        _fill(pump, 0, MSG_WAITFORONE)
        return
    for number in range(pump.bus_count):
        bus = &pump.buses[number]
        pump.polled[number].fd = <int> bus.fd if bus.failure == 0 else -1  # which poll leaves out
        pump.polled[number].events = POLLIN
        pump.polled[number].revents = 0
    poll(pump.polled, pump.bus_count, RETRY_MS if is_late else WAIT_MS)
    for number in range(pump.bus_count):
        if pump.polled[number].revents != 0:
            _fill(pump, number, MSG_DONTWAIT)


cdef inline void _fill(Pumped* pump, int64_t number, int flags) noexcept nogil:
    """Take a batch of frames of a bus."""
    cdef int got, error
    cdef int64_t place
    bus = &pump.buses[number]
    headers = pump.headers + number * BATCH
    for place in range(<int64_t> BATCH):
        headers[place].msg_hdr.msg_controllen = CONTROL_BYTES
    got = recvmmsg(<int> bus.fd, headers, BATCH, flags, NULL)
    error = errno
    bus.next = 0
    bus.count = max(got, 0)
    if got >= 0:
        _note_stamp(pump, number)
    elif error != EAGAIN and error != EINTR:
        bus.failure = error


cdef inline int64_t _earliest(Pumped* pump) noexcept nogil:
    """The bus whose next frame is the earliest of those that wait; -1: none waits."""
    cdef int64_t number, earliest = -1
    for number in range(pump.bus_count):
        bus = &pump.buses[number]
        if bus.failure != 0:
            continue
        if bus.next >= bus.count:
            if pump.bus_count > 1:
                _fill(pump, number, MSG_DONTWAIT)
            if bus.next >= bus.count:
                continue
        if earliest < 0 or bus.stamp < pump.buses[earliest].stamp:
            earliest = number
    return earliest


cdef inline void _note_stamp(Pumped* pump, int64_t number) noexcept nogil:
    """The stamp of a bus's next frame, and what the kernel says of lost ones."""
    cdef int64_t stamp = 0, place, by_kernel, by_interface
    cdef int64_t[6] times
    cdef uint32_t overflows
    cdef cmsghdr* said
    cdef msghdr* header
    bus = &pump.buses[number]
    if bus.next >= bus.count:
        return
    place = number * BATCH + bus.next
    if pump.headers[place].msg_len == SLOT_BYTES:
        memcpy(&bus.stamp, pump.frames + (place + 1) * SLOT_BYTES - sizeof(int64_t), sizeof(int64_t))
        return
    header = &pump.headers[place].msg_hdr
    said = CMSG_FIRSTHDR(header)
    while said != NULL:
        if said.cmsg_level == SOL_SOCKET:
            if said.cmsg_type == SO_TIMESTAMPNS:
                memcpy(times, CMSG_DATA(said), 2 * sizeof(int64_t))
                stamp = times[0] * NANOSECONDS + times[1]
            elif said.cmsg_type == SO_TIMESTAMPING:
                memcpy(times, CMSG_DATA(said), 6 * sizeof(int64_t))
                by_kernel = times[0] * NANOSECONDS + times[1]
                by_interface = times[4] * NANOSECONDS + times[5]
                stamp = by_kernel
                if by_interface != 0:
                    if not bus.has_offset:
                        bus.offset = (by_kernel if by_kernel != 0 else now(CLOCK_REALTIME)) - by_interface
                        bus.has_offset = True
                    stamp = by_interface + bus.offset
            elif said.cmsg_type == SO_RXQ_OVFL:
                memcpy(&overflows, CMSG_DATA(said), sizeof(overflows))
                bus.overflows = overflows
        said = CMSG_NXTHDR(header, said)
    bus.stamp = stamp if stamp != 0 else now(CLOCK_REALTIME)


cdef inline bint _take_frame(Pumped* pump, Pipeline* pipeline, int64_t number) noexcept nogil:
    """Take the next frame of a bus through the pipeline: whether Python must do something first."""
    cdef uint32_t identifier
    cdef int64_t place, length, key, stamp, published = pipeline.publisher.memory.published
    cdef uint8_t* frame
    cdef bint waits, has_rates
    bus = &pump.buses[number]
    place = number * BATCH + bus.next
    if pump.headers[place].msg_len == 0:  # a pair of sockets whose other end was closed
        bus.failure = ENODEV
        return False
    frame = pump.frames + place * SLOT_BYTES
    memcpy(&identifier, frame, sizeof(identifier))
    length = min(<int64_t> frame[4], <int64_t> LONGEST_FRAME)
    key = number * BUS_KEY
    key += EXTENDED_KEY + (identifier & CAN_EFF_MASK) if identifier & CAN_EFF_FLAG else identifier & CAN_SFF_MASK
    stamp = bus.stamp
    bus.next += 1
    _note_stamp(pump, number)
    if identifier & (CAN_ERR_FLAG | CAN_RTR_FLAG):
        if identifier & CAN_ERR_FLAG:
            _note_error(pump, number, identifier, frame + HEADER_BYTES, length)
        return False
    waits = handle(pipeline, key, frame + HEADER_BYTES, length, stamp)
    if pipeline.publisher.memory.published > published:
        pump.memory.brought, pump.memory.brought_at = pipeline.publisher.memory.published - published, stamp
    has_rates = pipeline.publisher.memory.frames > 0
    _send_results(pump, &pipeline.publisher)
    if has_rates:
        _note_latency(pump, now(CLOCK_REALTIME) - stamp)
    _note_arrival(pump, key)
    return waits


cdef inline void _note_latency(Pumped* pump, int64_t latency) noexcept nogil:
    """Note the latency of rates [ns], from the stamp of the frame that caused them until they are sent."""
    cdef int64_t bits, place = 0
    if not 0 <= latency < LARGEST_LATENCY:  # a recording, or a clock that was set
        return
    bits = observer_rt_bits(latency)
    if bits > SHORTEST_LATENCY:
        place = (bits - 1 - SHORTEST_LATENCY) * 4 + ((latency >> (bits - 3)) & 3)
    pump.memory.latencies[min(place, <int64_t> LATENCIES - 1)] += 1
    pump.memory.largest_latency = max(pump.memory.largest_latency, latency)


cdef inline void _note_arrival(Pumped* pump, int64_t key) noexcept nogil:
    """Note when a watched frame came, once its rates are sent, for asking for the time may be a system call."""
    cdef int64_t watched
    for watched in range(pump.arrival_count):
        arrival = &pump.arrivals[watched]
        if arrival.key == key:
            arrival.last = now(CLOCK_MONOTONIC)
            arrival.frames += 1
            break


cdef inline void _note_error(
    Pumped* pump, int64_t number, uint32_t identifier, const uint8_t* data, int64_t length
) noexcept nogil:
    """Keep an error frame for Python."""
    bus = &pump.buses[number]
    error = &pump.errors[number * ERRORS + bus.errors % ERRORS]
    error.identifier = identifier
    error.length = min(length, <int64_t> 8)
    memcpy(error.data, data, error.length)
    bus.errors += 1


cdef inline int64_t now(int clock) noexcept nogil:
    """Time of a clock [ns]."""
    cdef timespec read
    clock_gettime(clock, &read)
    return read.tv_sec * NANOSECONDS + read.tv_nsec


cdef inline void _wake_python(Pumped* pump, Observer* observer, int wake) noexcept nogil:
    """Wake Python when something happened that it waits for."""
    cdef uint64_t once = 1
    cdef int64_t number, reported = observer.memory.counts.events_closed + observer.memory.judgement.events_taken
    for number in range(pump.bus_count):
        reported += pump.buses[number].errors + (1 if pump.buses[number].failure != 0 else 0)
    if reported != pump.memory.reported:
        pump.memory.reported = reported
        write(wake, &once, sizeof(once))
