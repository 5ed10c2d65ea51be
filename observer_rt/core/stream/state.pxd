# Records of the stream, as numpy owns them, and the structure of an observer for its functions.

from libc.stdint cimport int64_t

from observer_rt.core.model.hydraulics cimport NOZZLE_NUMBERS, Seat
from observer_rt.core.model.needle cimport NEEDLE_NUMBERS, NeedleLaw
from observer_rt.core.model.network cimport CURVES, PIECES
from observer_rt.core.model.records cimport MOST_COEFFICIENTS
from observer_rt.core.model.sensor cimport SENSOR_GAIN, SENSOR_NUMBERS, InputTerms, Sensor
from observer_rt.core.model.valve cimport Valve

cdef enum:
    RING = 32768  # samples remembered: 0.33 s at 100 kHz
    MASK = RING - 1
    RECORDED_RING = 8192
    RECORDED_MASK = RECORDED_RING - 1
    MAX_EVENT = 16384  # samples; a longer event is not learned
    PENDING_EVENTS = 512  # closed, not yet judged
    INJECTIONS = 1024  # finished, not yet reported
    SLOTS = 8  # events that may have a verdict before they are taken
    COMMANDS = 64  # of the injector, that are remembered
    RAIL = 0
    LIFT = 1
    LINE = 2
    RAIL_BINS = 32  # of the rail pressure
    CURVE_NUMBERS = 4 * PIECES  # of a curve of the network: its pieces' cubics
    OUTPUTS = 2

cdef enum:  # Break: why a sample does not follow its predecessor
    BREAK_NONE = 0
    BREAK_START = 1  # the first sample
    BREAK_JUMP = 2  # legal jump of a windowed source
    BREAK_LOSS = 3  # samples were lost
    BREAK_RESTART = 4  # the device's index began anew

cdef enum:  # Doubt: fault of a sample that is there but cannot be trusted; numbers are those of `Reason`
    DOUBT_NONE = 0
    DOUBT_TIME_BASE = 16  # when it was taken is not known well enough
    DOUBT_FROZEN = 24  # an input keeps its value for longer than can be bridged
    DOUBT_CLIPPED = 25  # an input stays at the end of its range

cdef enum:  # State: of the service as a whole; sent in every output frame
    STATE_STARTING = 0
    STATE_WAITING_FOR_DATA = 1
    STATE_RUNNING_NOMINAL = 2
    STATE_ADAPTED = 3
    STATE_DEGRADED = 4

cdef enum:  # VerdictKind: what the stream found when an event was due
    TAKEN_NOTHING = 0  # it was not judged
    TAKEN_EXAMINED = 1  # by the innovations of the live x~; with what was learned from an earlier one, if that is new
    TAKEN_LEARNED = 2  # with what was learned from it

cdef enum:  # Stepping
    STEPPING_START, STEPPING_PREDICT, STEPPING_CORRECT


cdef struct Recorded:
    int64_t index
    double values[3]  # rail pressure [Pa], needle lift [m], line pressure [Pa]
    double shares[3]  # 0..1, by which it lies between two of its channel; of a lift, how much later
    unsigned char interpolated
    signed char broken  # Break
    signed char doubt  # Doubt

cdef struct Sample:
    # as received, normalised by (24), lift in m
    int64_t index
    double rail_pressure
    double needle_lift
    double line_pressure
    double lift_after  # share of an interval by which the lift was taken later than the rest
    double rail_share  # in the rail pressure, of the later one of two neighbours
    double lift  # m, the recorded one without what `lift_zero` takes for no motion
    unsigned char interpolated
    signed char broken  # Break
    signed char doubt  # Doubt
    signed char bridged  # a bit for every channel whose value does not count
    # as computed
    double lift_area  # normalised seat area when the lift was taken
    double seat_area  # u2
    double valve  # opening of the pilot valve, by what was seen of the lift so far (stepper.pyx)
    double opened_since  # s
    unsigned char resting
    double innovation  # e~ of x~, in units of p_0; 0 where the line pressure is not known
    double indicated  # line pressure as the lagging sensor of x~ shows it, without offset
    double phi[3]  # 1/s
    double injection_rate  # m3/s, by the filters of live.pxi where they follow; NaN while not synchronised
    double open_loop_rate  # m3/s, that of x^
    double rate_sigma  # m3/s, of the injection rate by the filters; NaN where they do not follow
    double as_believed  # weight of the filter by which the injector is as believed
    unsigned char valid
    signed char state  # State
    signed char reason  # Reason

# standstill.pxi: sums of squares of fourth differences, whose spikes are limited
cdef struct Differences:
    int64_t count
    double rail_squares
    double line_squares

# standstill.pxi: offset and noise of samples with a closed needle so far
cdef struct Standstill:
    int64_t rest_count
    double offset_sum
    Differences differences

# lift_zero.pxi: what the lift shows of a shut needle
cdef struct RestingLift:
    double zero  # m
    double quick_squares  # m2, running mean of the square of `quick`: lift_step.pxi
    double crosstalk  # m of lift by the line pressure's p_0, as it is taken out; 0: none was found
    int64_t lift_count
    double lift_variance  # m2, of the noise: a running mean

cdef struct Event:
    int64_t number
    int64_t due_index  # judged at the first sample >= this with the needle shut and settled
    int64_t start_position  # of the first and the last sample of its learning window
    int64_t end_position
    int64_t opening_position  # of its first sample with the needle open
    unsigned char learnable
    signed char fault  # Reason its samples are not to be trusted, 0 when they are
    int64_t closed_index  # of the sample at which it closed
    int64_t judged_before  # events, when it closed
    int64_t injections  # begun, when it closed
    signed char taken  # stream.VerdictKind, once it was judged
    # as they were at the event's end
    Standstill standstill
    RestingLift resting_lift

cdef struct Channel:
    double noise  # standard deviation of a sample, as normalised as it is
    double last  # value as it came
    double change  # running mean from sample to sample
    int64_t until  # position before which every sample is looked at
    int64_t run  # samples in a row with the value of the one before
    int64_t needed  # of them, until it is frozen
    unsigned char is_dropout  # it leapt there
    double instead  # value before it did
    int64_t repeats  # of all samples, those that only by chance have the value of the one before
    double held  # value at which it was frozen last
    unsigned char is_held  # it has not moved since
    unsigned char went_above  # it has been higher than that since,
    unsigned char went_below  # and lower: no end of a range
    unsigned char is_clipped  # it was the time before as well
    int64_t bridged  # lately: samples that do not count less others since

cdef struct Injection:
    int64_t number
    int64_t event
    int64_t start_position  # of the window's first sample
    int64_t end_position  # of its last, -1 while not known
    int64_t start_index
    int64_t end_index
    double volume  # m3, by the rate as it was sent
    double predicted_volume  # m3, by what was learned before: that of x^
    double peak_rate  # m3/s
    int64_t opening_index  # of its first sample with the needle open
    unsigned char opening_seen  # else it was open when the samples began
    double rail_pressure  # at its opening, normalised
    double known_from  # rail pressures at which the flow was known then
    double known_to
    unsigned char valid
    signed char reason  # Reason of its first sample that is not valid
    int64_t phi_version
    signed char state
    double middle_x[3]  # x^ and inputs in the middle of the window
    double middle_u[2]

# The observer's memory by owner: each struct is written by the file named above it, of this folder or of observer_rt.
# A file beside a field writes that, too. Whoever makes an observer (engine/observer.py) puts all in order first.

# step.pxi: how far samples have come
cdef struct Positions:
    # numbers of recorded samples: recorded >= released
    int64_t recorded  # taken in
    int64_t released  # what is stated of their channels is undone
    int64_t unbroken_since  # number of the first sample since the last break
    # positions in the stream of samples: received >= inspected >= processed
    int64_t received
    int64_t interpolated  # how many of these are
    int64_t inspected  # for outliers
    int64_t processed
    int64_t newest_break  # position of the newest sample that does not follow the one before
    int64_t segment_start  # position of the first sample since the last break

# engine/service/core.py
cdef struct Mode:
    unsigned char draining  # no more samples will come: do without look-ahead
    unsigned char waits_for_verdicts  # else an event without one when it is due is not judged

# engine/observer.py: when the injector was energized, where its pilot valve goes by that; the n-th at n % COMMANDS
cdef struct Commands:
    int64_t count
    int64_t answered  # by a needle that is shut again (front_end.pxi)
    int64_t landed  # position up to which a needle that bounces counts as open, though it rests before
    int64_t starts[COMMANDS]  # sample index
    double lengths[COMMANDS]  # samples, infinite while not known

# engine/observer.py: what is known before the first sample, and stays
cdef struct Prior:
    double healthy_variance  # what e~ of a healthy injector has, over its square; 1 if the model is right
    double stated_noise[3]  # of rail and line pressure [p_0] and lift [m], until it is measured

# judgement.pxi, from a verdict: theta as the loop carries it
cdef struct Carried:
    double curves[CURVES][CURVE_NUMBERS]
    double bias[OUTPUTS]
    double nozzle[NOZZLE_NUMBERS]
    double learned_offset
    double sensor[SENSOR_NUMBERS]  # as the model in force and what was learned say
    double flow_factor  # on flows: of the rail pressure, by what was learned of its sensor
    double line[MOST_COEFFICIENTS]  # its coefficients with what was learned of it
    Valve valve
    double needle[NEEDLE_NUMBERS]
    int64_t watch_later  # samples by which innovations are watched later, 0 without control flow
    # where the flow is known well enough: rail pressures, and for each bin of them times since the needle opened [s]
    double rail_from
    double rail_to
    double known_from[RAIL_BINS]  # for a needle that falls
    double known_until[RAIL_BINS]
    double flow_spread  # standard deviation, as a share, by which flows of late were others than believed
    double coloured_noise  # p_0^2, of white noise as loud as that of the line pressure where it is loudest; 0: it is white

# judgement.pxi: what innovations are to be like
cdef struct InnovationNoise:
    double sigma  # standard deviation of e~, in units of p_0
    double weight  # 1 / the mean square that is expected

# judgement.pxi: whether what was learned tells the flow of the injection under way
cdef struct OperatingPoint:
    unsigned char in_learned_range  # the flow is known well enough for an injection as the last one
    double known_from  # s since it opened, for its rail pressure
    double known_until
    double full_rate  # m3/s, steady through a full nozzle as believed, at its rail pressure
    double widest  # seat area so far
    double up_until  # s since it opened, until which it did not fall
    double flow  # sum of the rates of its samples with an open needle
    int64_t flowing  # how many they are

# judgement.pxi
cdef struct Judgement:
    signed char reason  # Reason the last judged event did not pass, 0 when it did
    int64_t untested  # events in a row that could not be tested
    int64_t events_judged
    int64_t doubtful_events  # of these
    int64_t events_taken
    unsigned char waiting  # the head of `events` is due and must be judged before going on: step.pxi
    int64_t halted_in  # event in which a needle stopped too low (step.pxi, false_openings.pxi), 0 once one has passed
    int64_t phi_version
    unsigned char offset_moves  # slow innovations at rest are the offset's, not the colour of the noise

# pair.pxi: the pair x~, x^ is in the ring; what else it needs
cdef struct Pair:
    double offset  # the learned one (judgement.pxi), moved by what the standstill shows
    int64_t since_start  # samples since x~ started

# innovation_monitor.pxi
cdef struct InnovationMonitor:
    int64_t watched  # position up to which innovations were (pair.pxi)
    double normalised_innovation_squared  # running mean of e~^2 by the weight of its noise
    unsigned char contradicted  # it has left what noise can do, and no event passed since (judgement.pxi)
    unsigned char alarm_at_standstill  # by a channel, for the injector did nothing
    int64_t calm  # samples since it was
    int64_t contradicted_in  # number of the first event that can tell otherwise
    double lowest_drop  # line less rail pressure meanwhile
    int64_t falls  # of the line pressure, in a row, as by an injection though no needle opened (events.pxi)

# step.pxi: whether x~ has settled
cdef struct Synchronisation:
    unsigned char synchronised
    signed char unsynchronised_by  # Reason
    int64_t closed_since_start  # samples with a closed needle since x~ started (pair.pxi)
    int64_t rested  # position of the last sample with the needle long shut
    int64_t numerical_resets

# events.pxi
cdef struct Needle:
    unsigned char is_open
    int64_t shut_index  # of the first closed sample
    int64_t opening_position  # of the first sample of the last opening

# events.pxi
cdef struct EventUnderWay:
    unsigned char in_event
    int64_t number
    int64_t opening_position  # of its first opening
    unsigned char learnable  # not after what step.pxi and false_openings.pxi find
    signed char fault  # Reason its samples are not to be trusted (step.pxi, false_openings.pxi), 0 when they are

# events.pxi
cdef struct Counts:
    int64_t events_closed
    int64_t injections_begun
    int64_t injections_reported  # or given up: engine/service/judging.py
    int64_t unseen_injections  # falls of the line pressure as by an injection, though no needle opened

# front_end.pxi: the part of a ramp that a lift recorded too low does not show
cdef struct Ramp:
    int64_t foot  # position of the first sample whose recorded lift counts
    double foot_lift  # m, lift at the sample before
    double rise  # m a sample
    double sinking_lift  # m, of a needle no longer recorded as open
    double fall  # m a sample, 0 while the recorded lift counts (step.pxi)

# lift_zero.pxi
cdef struct DeadBand:
    double lift_on  # m
    double lift_off

# lift_zero.pxi: how the zero of the lift is followed
cdef struct LiftZero:
    int64_t lifted  # position as far as `lift` is known
    int64_t count
    double mean  # m, running mean
    double near  # m, a shorter one, and
    double behind  # .. the running mean of that
    double moves  # m2, mean square of their difference
    double slope  # m a sample, 0 while that is noise
    int64_t followed  # position of the last sample in them
    double spread  # m2, mean square of the lift about it: noise of any colour
    double variance_lately  # m2, of the noise: a shorter mean

# crosstalk.pxi, its mean lift_zero.pxi, too: of the lift of a shut needle on the line pressure
cdef struct CrosstalkRegression:
    double line_mean  # of the line pressure, running as the zero does
    int64_t count
    double swing_squares  # fading sums: of the line pressure about its mean,
    double swing_lifts  # and of its products with the lift about its zero
    double squares_lately  # shorter ones of the same
    double lifts_lately

# lift_stop.pxi: where the lift of an open needle stays
cdef struct Stop:
    double level  # m, mean of the samples that differ little, and
    int64_t level_count  # .. how many they are
    double highest  # m, of this opening, 0 where it stayed nowhere
    double lift  # m, running mean of the openings that went furthest
    int64_t openings

# lift_step.pxi
cdef struct LiftStep:
    double quick  # m, mean over some samples of the lift about its zero
    double quick_limit  # m2, of its square: more is a step
    int64_t quiet  # position of the last sample at which it was small
    int64_t stepped  # position at which a step of the zero was found
    double before_step  # m, the zero before it
    double summit  # m, highest lift since it opened

# standstill.pxi: the standstill under way
cdef struct Rest:
    int64_t run  # samples
    double highest_line  # line pressure of the run, normalised
    int64_t at_highest  # samples of a rest in a row that repeat it exactly: its range ends there
    Differences before  # what was known when the event before closed

# outliers.pxi
cdef struct Outliers:
    double accepted_innovation  # the last of x~ that did not leap, 0 when it started (pair.pxi)
    int64_t leaping  # samples since
    int64_t spikes
    int64_t bridged

cdef struct ObserverMemory:
    Positions positions
    Mode mode
    Commands commands
    Prior prior
    Carried in_force
    InnovationNoise innovation_noise
    OperatingPoint operating_point
    Judgement judgement
    Pair pair
    InnovationMonitor monitor
    Synchronisation synchronisation
    Needle needle
    EventUnderWay event
    Counts counts
    Ramp ramp
    DeadBand dead_band
    RestingLift resting_lift
    LiftZero lift_zero
    CrosstalkRegression crosstalk
    Stop stop
    LiftStep lift_step
    Standstill standstill
    Rest rest
    Outliers outliers
    # frames/inputs.pxd, and engine/service/optional_inputs.py when the model has changed
    signed char input_fault  # Reason all that comes now is not to be trusted, 0 when it is

cdef struct Finding:
    int64_t number  # of the event it is on, from 1 in the order in which they closed
    signed char reason  # Reason it did not pass, 0 when it did
    unsigned char is_coloured  # the innovations are, by what is known of the noise
    double at_rest  # mean square of coloured ones with the needle shut, nan: as it was

cdef struct Verdict:
    Finding examined
    Finding learned
    int64_t earlier  # the event's number, if what was learned from one before is to take force with it
    # what was learned
    unsigned char is_adopted
    double innovation_sigma
    double noise[3]  # of the channels
    Carried carried

# Durations in samples.
cdef struct Timing:
    int64_t settle  # closed needle after which the sac is at rest and x^ follows x~
    int64_t good  # closed needle after which x~ is good again
    int64_t event_gap
    int64_t learning_delay
    int64_t window_lead  # injection window: before the opening
    int64_t window_tail  # and after the needle is shut
    int64_t learning_lead  # learning window: before the event's first opening
    int64_t lookahead  # samples the observer must know beyond the one in hand
    int64_t toe  # most samples of an opening ramp that a lift recorded too low does not show
    int64_t ramp  # samples beyond the first of a ramp from which its slope is taken
    int64_t confirm  # samples in a row above the dead band that open the needle
    int64_t bounce  # closed needle after which its lift is its zero
    int64_t stays  # for which a low lift that the line pressure does not show is none of an open needle
    int64_t bridge  # most samples of a channel that may be missing
    unsigned char filtered  # samples come fast enough for a spike to be told from the line

# Corrections of channels before the observer sees a sample; that of the line pressure is in the model.
cdef struct Undoing:
    unsigned char stated  # whether there is anything
    int64_t rail_late  # samples; sample k + rail_late of the rail pressure is of the time `rail_fraction` (0..1) of a
    double rail_fraction  # .. sample before k
    double lift_lag  # samples: time constant of the lift's sensor
    int64_t ahead  # samples that must be known beyond one

cdef struct Constants:
    double pressure_scale  # p_0, Pa
    double chamber_pressure  # p_C, Pa
    Seat seat
    unsigned char means  # samples are means over the sample period that ends at their time
    InputTerms inputs
    Sensor sensor
    double interval  # s
    Timing timing
    int64_t events_required  # judged events before a sample can be valid
    double rail_every  # samples to one of the rail pressure
    Undoing undoing
    double quickest  # m a sample: no needle is
    NeedleLaw needle  # that answers the commands, for its lift is not recorded; else one without a stop

# What steps the pair: one of STEPPING_, at a position.
ctypedef double (*Step)(void* stepper, int64_t what, int64_t position) noexcept nogil

cdef struct Observer:
    Constants constants
    ObserverMemory* memory
    Recorded* recorded  # (RECORDED_RING,)
    Sample* ring  # (RING,)
    int64_t states
    double* x_tilde  # (RING, states)
    double* x_hat
    int64_t gain_rows
    double* gains  # (gain_rows, states) gain schedule in force
    Event* events  # (PENDING_EVENTS,)
    Injection* injections  # (INJECTIONS,)
    Channel* channels  # (3,)
    int64_t parameters
    double* theta  # (parameters,)
    Verdict* verdicts  # (2 SLOTS,)
    double* verdict_gains  # (2 SLOTS, gain_rows, states)
    double* verdict_theta  # (2 SLOTS, parameters)
    Step step
    void* stepper

