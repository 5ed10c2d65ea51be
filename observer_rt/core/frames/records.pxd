# Records of the frame pipeline, as numpy owns them, and the structures its functions take of them.

from libc.stdint cimport int64_t, uint32_t, uint64_t, uint8_t

from observer_rt.core.stream.state cimport Observer, Recorded

cdef enum:
    MAX_INPUTS = 3
    MAX_SIGNALS = 512  # decoded from one frame, for one group of samples
    LONGEST_FRAME = 64  # bytes
    POINTS = 16
    SURROUNDINGS = 2  # quantities round the injector that change the model

cdef extern from *:
    """
    #include <stdint.h>
    #define INDEX_MASK ((int64_t) 0xFFFFFFFF)
    #define NANOSECONDS ((int64_t) 1000000000)
    """
    const int64_t INDEX_MASK  # of a sample index as sent
    const int64_t NANOSECONDS  # of a second


cdef struct Signal:
    int64_t kind
    int64_t first_byte  # the byte with the least significant bit
    int64_t step  # to the byte with the next higher bits: +1 little-endian, -1 big-endian
    int64_t byte_count  # bytes touched, 1 to 9
    uint64_t shift  # of the least significant bit in its byte
    uint64_t mask  # as many ones as the field has bits
    uint64_t sign  # the sign bit of a signed field
    double scale
    double offset
    double lowest  # raw, that is sent: by minimum and field
    double highest
    double least  # raw, that is received: what is below, or above `most`, is no value
    double most
    double largest  # raw, that is a value, were it not for the declared range
    unsigned char has_not_available
    uint64_t not_available
    uint64_t instead_of_not_available  # nearest code that is an ordinary number
    unsigned char has_error
    uint64_t error
    uint64_t instead_of_error


cdef struct Condition:
    int64_t selector
    uint64_t value


cdef struct Protection:
    int64_t profile
    int64_t data_id


cdef struct Supervision:
    int64_t state  # E2EState
    int64_t counter  # of the last frame with a good CRC, -1: none yet
    # of the last frames, the newest in the lowest bit
    int64_t ok_frames
    int64_t error_frames
    int64_t ok  # how many of them
    int64_t errors
    int64_t refused  # good frames that came while the state was INVALID
    # as the bench says
    int64_t window  # frames
    int64_t min_ok[4]  # by state
    int64_t max_errors[4]


cdef struct GridStream:
    unsigned char on_grid  # its index is the grid's; else it is a follower
    unsigned char spared  # nothing waits for it, for it has no role that is used
    unsigned char seen
    int64_t first_index  # of the first sample, unwrapped
    int64_t next_index  # of the sample expected next
    int64_t last_start  # of the last accepted block
    int64_t jump_block  # start of the last block before the last gap of this message
    int64_t jump_from  # that gap: [jump_from, jump_to)
    int64_t jump_to
    unsigned char jump_contiguous  # by the E2E counter
    int64_t old_blocks  # consecutive
    int64_t old_next


# A message with samples between those of the grid, or further apart.
cdef struct Follower:
    int64_t roles  # bit r: carries ROLES[r]
    double spacing  # samples of the grid between two of its own
    double reach  # samples of the grid between two of its own that a straight line joins
    unsigned char holds  # its last value counts for `reach`
    double early  # samples of the grid by which its values are of before its samples' time
    unsigned char begun
    double position  # of its last sample on the grid
    double values[MAX_INPUTS]  # SI
    int64_t first_index  # of the first sample of the grid that has its values
    int64_t next_index  # of the first that has not got them yet
    int64_t lift_row  # index of the sample of the grid that has its last lift
    double lift_after  # by how much [samples of the grid] it was taken later than that
    int64_t shut_for  # its samples in a row with a closed needle
    unsigned char stale  # the others do not wait for it any longer


cdef struct Slot:
    int64_t index
    int64_t present
    unsigned char interpolated  # over a gap of a follower
    double values[MAX_INPUTS]
    double shares[MAX_INPUTS]  # 0..1: see `alignment.store`


cdef struct AlignmentMemory:
    int64_t stream_count
    int64_t next_index  # of the sample to decide on next
    int64_t newest  # index beyond the last sample any message sent
    unsigned char begun
    signed char next_break  # of the first sample to come: START or RESTART
    int64_t last_index  # of the last sample passed on
    double last_values[MAX_INPUTS]
    double closed_lift  # m, at or below which the needle is closed
    unsigned char lacks_lift  # no lift is used: each is 0, whatever is sent
    int64_t decided  # samples written to the ring
    # counters
    int64_t lost  # samples
    int64_t repeated  # blocks
    int64_t old
    int64_t restarts
    int64_t jumps


cdef struct Clock:
    double interval  # ns, nominal, between two samples
    int64_t samples  # of a frame
    double shortest  # ns from one frame to the next that a bus can do
    unsigned char begun
    int64_t first_index
    int64_t first_stamp  # ns
    int64_t last_stamp
    # the window under way
    double window_end  # ns after the first stamp
    double lowest  # ns, of the excess
    double lowest_at  # samples after the first
    double latest  # ns, of the delays
    int64_t frames
    int64_t prompt
    double waited  # ns, sum of the delays
    int64_t together  # frames that came sooner after their predecessor than a bus can carry them
    # finished windows
    int64_t points
    double places[POINTS]  # samples after the first
    double excesses[POINTS]  # ns, of the stamp over the nominal time
    # the line under the excesses
    double offset  # ns
    double drift  # ns a sample
    double residual  # ns that the line may be off by, infinite while it is not known
    double spread  # ns, greatest delay of the last window
    double usual  # ns, what the windows before had
    double raised  # ns, by which its lowest stamp lay above the line before
    # delays since the line is known
    int64_t delays
    double delay_sum  # ns
    double delay_squares
    double delay_max


cdef struct Counting:
    int64_t modulus  # of the counter; 1 without one
    unsigned char begun
    int64_t number  # of the last frame
    int64_t sequence  # its counter
    int64_t old  # frames older than the last, consecutive


cdef struct Shift:
    unsigned char is_known
    int64_t samples  # from the number of a sample to its index on the grid
    double off  # samples that the clocks place it beside that index


cdef struct TimekeepingMemory:
    int64_t leading  # message whose samples are the grid
    unsigned char by_stamps  # whether any message needs them


cdef struct Timing:
    int64_t joining
    int64_t numbering
    int64_t modulus  # of the counter, 1 without one
    int64_t steps  # samples of the grid from one sample of the message to its next
    double interval  # s between two samples of the message
    double delay  # s from a frame's last sample to its stamp, without waiting
    double shortest  # s from frame to frame, below which stamps are not those of a bus
    double hold  # s, of a slower signal
    double tolerance  # s that its time may be unknown by


cdef struct InputMessage:
    int64_t key
    int64_t length  # bytes, by the database
    int64_t padded_length  # bytes, as CAN FD carries a message of this length
    Protection protection
    int64_t samples  # of every role, in all frames that share one sample index
    int64_t first_group
    int64_t group_count
    int64_t first_optional
    int64_t optional_count
    int64_t first_kind  # of the frames that share one sample index
    int64_t kind_count


# Samples of one or more roles that come together and are aligned with those of other streams.
cdef struct InputStream:
    int64_t samples  # of every role, in all frames that share one sample index
    int64_t roles  # bit r: carries ROLES[r]


# Consecutive samples that one frame carries: all of a message's, or those under one selector value.
cdef struct InputGroup:
    int64_t stream  # that the group is a part of
    int64_t offset  # of the first sample from the frame's sample index
    int64_t samples  # of every role
    int64_t position[MAX_INPUTS]  # of a role's first sample among the decoded values
    double factor[MAX_INPUTS]  # to SI
    int64_t first_signal  # rows of the signal table: index or counter, if any, then the samples
    int64_t signal_count
    int64_t first_condition  # rows of the conditions that a frame with this group meets
    int64_t condition_count


cdef struct OptionalInput:
    int64_t role  # OPTIONAL_ROLES[role], or ENERGIZING
    int64_t surrounding  # place among the surroundings, -1: it is none; its value must lie between these [SI]
    double lowest
    double highest
    unsigned char is_placed  # by its first signal, the index of its first sample
    double factor  # of its other signals, to SI
    double origin  # what their 0 is in SI
    double timeout  # s, after which a value counts no longer
    int64_t first_signal
    int64_t signal_count
    int64_t first_condition
    int64_t condition_count


# A kind of frame. A message has a single one, or one for every selector value that carries samples.
cdef struct InputKind:
    int64_t end  # offset after its last sample
    uint8_t blank[LONGEST_FRAME]  # the frame with its selectors set and all else 0


cdef struct OptionalValue:
    double value  # SI, the newest, nan: none
    double left  # samples for which it counts
    unsigned char follows  # by the protection of its message no frame was lost since


cdef struct Reading:
    int64_t row  # of `Inputs.optional`
    int64_t stamp  # ns
    unsigned char follows
    # when it came
    int64_t processed  # samples
    int64_t closed  # injections


cdef struct OptionalMemory:
    int64_t newest  # index of the newest sample when a frame came last, -1: there was none
    unsigned char may_learn  # by the bench
    unsigned char learning  # .. and by its learning enable
    unsigned char is_input[SURROUNDINGS]  # of the bench
    double measured[SURROUNDINGS]  # SI, that counts, nan: none
    double in_force[SURROUNDINGS]  # in the model, nan: it waits for one
    double steps[SURROUNDINGS]  # between the two, below which the model stays
    unsigned char is_assumed[SURROUNDINGS]  # for none was measured yet
    double since_change  # samples since the model changed
    unsigned char is_due  # Python must change the model before samples are observed
    # of `readings` and `values`
    int64_t came
    int64_t read  # by Python, which
    unsigned char looks_at_each  # .. wants to see what became of every frame
    unsigned char is_news  # a reading that waits has another value than the one before


cdef struct Receiver:
    int64_t last_counter[MAX_INPUTS]  # of every message's last frame that was placed, -1: none yet
    int64_t odd_length[MAX_INPUTS]  # of every message's last frame of another length than it has, -1: none came
    signed char interrupted[MAX_INPUTS]  # of every stream, 1: its last frame is not the message's
    double values[MAX_SIGNALS]
    double sample[MAX_INPUTS]  # SI
    double lowest[MAX_INPUTS]  # SI, of every role's values, those outside the declared range included
    double highest[MAX_INPUTS]
    int64_t outside[MAX_INPUTS]  # how many are, and are missing for it
    int64_t frames  # with samples, good or bad
    int64_t crc_errors
    int64_t length_errors
    int64_t sequence_errors


cdef struct OutFrame:
    int64_t length
    uint8_t payload[LONGEST_FRAME]


# Places of the header's signals among a frame's values, -1: not in the message.
cdef struct Header:
    int64_t sample_index
    int64_t valid
    int64_t learning
    int64_t state


cdef struct PublisherMemory:
    int64_t published  # position in the observer's stream of the next sample to publish
    int64_t block_start  # index of the block's first sample
    int64_t filled  # of the block, 0: none begun
    unsigned char block_valid  # all of it so far, without a gap
    int64_t block_state
    unsigned char learning
    unsigned char contested  # another node sends the same: nothing that goes out is valid
    Header header
    int64_t samples  # of a block, 0: no rates are published
    int64_t length
    Protection protection
    int64_t counter
    int64_t frames  # ready in `out`


cdef struct PumpBus:
    int64_t fd
    int64_t failure  # errno; the bus is left out until Python gives it a descriptor
    int64_t next  # frame of the batch
    int64_t count  # frames of the batch
    int64_t stamp  # of the next frame [ns]
    unsigned char has_offset
    int64_t offset  # ns, from the interface's clock to the computer's
    int64_t overflows  # frames lost, as the kernel counts them: 32 bits
    int64_t errors  # error frames so far


cdef struct ErrorFrame:
    int64_t identifier
    int64_t length
    uint8_t data[8]


cdef struct Arrival:
    int64_t key
    int64_t frames
    int64_t last


cdef struct PumpMemory:
    unsigned char is_to_stop
    int64_t reported  # events closed and taken, failures, errors that Python knows of
    int64_t turns
    int64_t unsent
    int64_t brought  # samples observed by the last frame that had any observed
    int64_t brought_at  # its stamp [ns]
    # results
    int64_t bus  # they go to, -1: none are sent
    uint32_t identifier
    int64_t flags
    int64_t size  # of a frame as the kernel takes it
    int64_t first_waiting
    int64_t end_waiting
    int64_t largest_latency  # ns, from the stamp of a frame until its rates are sent
    int64_t latencies[64]  # how many rates took so long, four to an octave from 1 us on


cdef struct Selection:
    const Signal* selectors
    const Condition* conditions


cdef struct Inputs:
    int64_t message_count
    const InputMessage* messages
    const InputStream* streams
    const InputGroup* groups
    int64_t optional_count
    const OptionalInput* optional
    const Signal* signals
    Selection selection


cdef struct Alignment:
    AlignmentMemory* memory
    GridStream* streams  # (MAX_INPUTS,)
    Follower* followers  # (MAX_INPUTS,)
    Slot* slots  # (SLOTS,)
    Recorded* recorded  # (RECORDED_RING,)


cdef struct Timekeeping:
    const TimekeepingMemory* memory
    int64_t messages
    const Timing* timing
    Clock* clocks
    Counting* counts
    Shift* shifts


cdef struct InputMemory:
    OptionalMemory* memory
    int64_t newest_count
    OptionalValue* newest
    Reading* readings  # (READINGS,)
    int64_t width
    double* values  # (READINGS, width) SI


cdef struct Publisher:
    PublisherMemory* memory
    int64_t signals
    const Signal* table
    double* values
    OutFrame* out  # (FRAMES,)


cdef struct Pipeline:
    Inputs inputs
    Receiver* receiver
    Supervision* supervised
    InputMemory input_memory
    Timekeeping keeping
    Alignment alignment
    Observer* observer
    Publisher publisher
