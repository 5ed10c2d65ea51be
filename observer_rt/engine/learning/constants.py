"""Numbers of the account, each with its unit, meaning and source.

Source: I information (a consequence of the noise or of Bayes' rule), P physics, M measured on recordings of plants
that share no code with the observer. Rates are not sensitive, for evidence is tens to thousands of nats: with ten
times more, or a hundredth, 3 of 355 injections are judged otherwise.
"""

# fmt: off
# What an event may be: prior probability an event.
QUICK_BEGINS, QUICK_ENDS = 1 / 40, 1 / 50  # M: without, 60 of 80 valid in a drift for 76, and .53 covered for .99
CHANGES = 1 / 1000  # of a sensor; half as many small ones of nozzle and seat (M: without these, 57 for 61)
LINE_CHANGES = 1 / 3000
FLOW_CHANGES = 1 / 100  # another nozzle, or a law that phi cannot hold beside those it has; M: 71 valid for 22 of 102
OTHER_INJECTOR = 1 / 10000  # or all was learned wrongly; M: without, a gross fault is felt for ten events more
SHIFTS = 1 / 100  # of all a little; M: without, 17 of 26 valid for 26 where friction grows with the pressure
NOT_AS_FILED = 1 / 20  # line, lag of a sensor, delay of the lift, each by itself, at the first event; P
FAULT_BEGINS, FAULT_STAYS = 1 / 100, 0.5  # of an event
INADEQUATE_BEGINS, INADEQUATE_STAYS = 1 / 1000, 0.9  # of the model

# From so many changes of the flow on, each older event counting for so much, it is a law that no event teaches; M:
# three among ten events, where a nozzle goes by rail pressure times time; one jump is one.
OFTEN, CHANGES_REMEMBERED = 2.0, 0.9

# How far theta may have moved.
QUICKER = 8.0  # usual drifts an event, of quick wear beside its velocity; M
SPEED, TURNS = 6.0, 0.5  # usual drifts an event: prior of the velocity, and its own change; M
SHIFT = 30.0  # usual drifts, of all; M
LIFT_DELAY_CHANGE = 30e-6  # s: an amplifier, or a filter ahead of a converter; P
LIFT_DELAYS = (-60e-6, -40e-6, -20e-6, 20e-6, 40e-6, 60e-6)  # s, at which a fit of the lift's delay may begin; M
OPENING_DELAYS, CLOSING_DELAYS = (-70e-6, 0.0, 70e-6), (-120e-6, 0.0, 120e-6)  # s, of a needle by commands; M
LINE_SENSOR_LAG = 40e-6  # s, at which a fit of a late line sensor begins; M
LEAST_LAG = 30e-6  # s, of a line sensor, that shows beside a needle by commands; M: else 20 us are found of none
MOVED_IN_TIME = 20e-6  # s, by which a needle moves at another time: some mm3/ms of a rate; M
FILED = 0.02  # of their prior, by which line and sensors may be off where no event has said otherwise; M
LAWLESS, ONE_SCALE = 0.6, 0.5  # probability that a flow has no law; of one that has, that all curves are alike; M
PAIRED, MOST_PAIRS = 0.01, 3  # probability that a law goes by two inputs at once, each two; pairs in use at most; M
CHOICES, CHOSEN = 8, 0.99  # of scales that the weights are a mixture of: at most, and of all of their probability; I
NUDGE = 0.03  # of a flow: the prior as a whole pays so much for its width that it hides such a change; M

# Which hypotheses are gone into.
NEAR = 0.1  # of the longest step, within which a linearisation is shared; M
FALLS, FALLS_FAR = 20.0, 100.0  # nats by which the cost falls: a fit is needed, and one of many steps; M
REFINED = 12.0  # nats behind the best, from which on nothing is looked at: 6e-6 of its weight; I
LEFT_ALIKE = 1.0  # nats of the cost, within which two fits leave the same innovations; I
FALL_COUNTS = 0.42  # of the fall, by which the closed form may be wrong: .41 at a nozzle that jumped by 43 %; M
BEYOND = 2.0  # nats that may lie beyond limits and the reach of a linearisation; I
LIVE = 5e-3  # weight from which on a hypothesis is carried on; M
RIVAL_LIVES = 1e-7  # .. where it explains all events by other elements: it takes some to tell a lag from a bounce; M
AGAINST_RIVAL = 5.0  # nats at most that one event counts against a rival: a needle unlike the model's misleads; M
SCALE_FITS = 3  # of an explanation, each at the scale of the weights that the one before makes the likeliest; M
FIRST_STEPS, STEPS = 8, 2  # Gauss-Newton iterations: of a fit from far, and of one from near

# Two beliefs.
ALIKE, ALIKE_VARIANCE = 1.0, 4.0  # standard deviations of the means; ratio of the variances: in one mode, one; M

# Mean squares over the healthy injector's, of samples and of blocks, up to which a model is adequate.
NEARLY_WHITE, NEARLY_WHITE_BLOCKS = 1.15, 1.6  # as the tests of adequacy; M

# The verdict.
AGREED = 0.95  # of the posterior; I
OWN_SHARE = 0.005  # of a mass, within which hypotheses agree whatever their interval; M
STROKE_SHARE = 0.0025  # of a mass, one sigma, that a needle moves unlike its model; M: on lines with waves
WRONG, SURELY = 0.03, 3.0  # of a mass, which the published one is not off by at so many standard deviations; P, I
FAR_FLOW = 0.02  # change of a flow, beyond which a volume is not followed along its slope; P
LEAST_OF_MIXED = 0.25  # of the lead's own variance, that hypotheses between them leave at least; M
LEAST_PART = 0.005  # weight, below which a hypothesis is no part of an interval; I

AHEAD = 2.0  # events by which what is carried is ahead of what was learned: it is carried during the second; P
# fmt: on
