/* Sends input frames at a pace, receives rate frames, and writes down when.
 *
 * usage: pacer LINK LOOP COUNT FIRST PERIOD_NS LINGER_MS BACKLOG_MS INPUT_ID RATE_ID DATA_ID OUT
 *
 * LOOP: frames (struct canfd_frame) sent again and again; sample index, counter and CRC (AUTOSAR E2E profile 5) go on.
 * One of length 0 is a pause: it has its time and its place in the index, and is not sent (0 in OUT).
 * FIRST: number of the first frame, as if those before it had been sent already. A frame that finds no room waits
 * here with all that follow, as on a device; one that is BACKLOG_MS late is given up. It ends LINGER_MS after the last
 * rate frame. OUT: int64 frames sent, rate frames received; then int64 ns of each frame sent (0: given up; of those
 * that had to wait when they were due); then int64 (index, ns) of each rate frame.
 */
#define _GNU_SOURCE
#include "frames.h"

#include <poll.h>
#include <sched.h>

enum { SAMPLES = 9, RATES = 28 };

static uint16_t table[256];

static void make_table(void)
{
    for (int i = 0; i < 256; i++) {
        uint16_t r = (uint16_t)(i << 8);
        for (int bit = 0; bit < 8; bit++)
            r = (uint16_t)(r & 0x8000 ? r << 1 ^ 0x1021 : r << 1);
        table[i] = r;
    }
}

static uint16_t add(uint16_t crc, uint8_t byte)
{
    return (uint16_t)(crc << 8 ^ table[crc >> 8 ^ byte]);
}

static void protect(struct canfd_frame *f, uint8_t counter, unsigned data_id)
{
    f->data[COUNTER_AT] = counter;
    uint16_t crc = 0xFFFF;
    for (int i = 2; i < f->len; i++)
        crc = add(crc, f->data[i]);
    crc = add(add(crc, data_id & 0xFF), data_id >> 8 & 0xFF);
    f->data[0] = crc & 0xFF;
    f->data[1] = (uint8_t)(crc >> 8);
}

struct rate {
    int64_t index, stamp;
};

struct heard {
    struct rate *rates;
    long count, room;
    int64_t last;
};

/* Whether there was a frame. */
static int hear(int s, canid_t wanted, struct heard *heard)
{
    struct canfd_frame f;
    ssize_t n = recv(s, &f, sizeof f, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return 0;
    if (n <= 0) {
        fprintf(stderr, "the other end is gone\n");
        exit(3);
    }
    int64_t stamp = now_ns();
    if (f.can_id != wanted)
        return 1;
    heard->last = stamp;
    if (heard->count < heard->room)
        heard->rates[heard->count++] = (struct rate){get_index(&f), stamp};
    return 1;
}

/* Whether there is something to hear, or, where `events` asks for it, room again. */
static int wait_until(int s, int64_t due, short events)
{
    int64_t left = due - now_ns();
    if (left < 0)
        left = 0;
    struct timespec t = {left / 1000000000, left % 1000000000};
    struct pollfd p = {s, events, 0};
    return ppoll(&p, 1, &t, NULL) > 0 && p.revents & ~POLLOUT;
}

int main(int argc, char **argv)
{
    if (argc != 12)
        return fprintf(stderr, "11 arguments, see the source\n"), 2;
    const long count = atol(argv[3]), first = atol(argv[4]);
    const int64_t period = atoll(argv[5]), linger = atoll(argv[6]) * 1000000, backlog = atoll(argv[7]) * 1000000;
    const canid_t input_id = (canid_t)atol(argv[8]), rate_id = (canid_t)atol(argv[9]);
    const unsigned data_id = (unsigned)atol(argv[10]);
    make_table();
    start_clock();
    prctl(PR_SET_TIMERSLACK, 1);
    /* A bus waits for nobody: where it is granted, nothing that is measured delays this. */
    const struct sched_param priority = {.sched_priority = 90};
    sched_setscheduler(0, SCHED_FIFO, &priority);

    FILE *file = fopen(argv[2], "rb");
    if (!file)
        fail(argv[2]);
    fseek(file, 0, SEEK_END);
    const long loop = ftell(file) / (long)sizeof(struct canfd_frame);
    rewind(file);
    struct canfd_frame *frames = malloc((size_t)loop * sizeof *frames);
    if (!frames || fread(frames, sizeof *frames, (size_t)loop, file) != (size_t)loop)
        fail(argv[2]);
    fclose(file);

    int64_t *sent = calloc((size_t)count, sizeof *sent);
    struct heard heard = {.room = 2 * count * SAMPLES / RATES + 1000};
    heard.rates = malloc((size_t)heard.room * sizeof *heard.rates);
    if (!sent || !heard.rates)
        fail("memory");
    memset(sent, 0, (size_t)count * sizeof *sent); /* so that no page is touched first while it counts */
    memset(heard.rates, 0, (size_t)heard.room * sizeof *heard.rates);

    const int s = open_frames(argv[1], rate_id);
    const int64_t start = now_ns() + 2000000;
    int is_held = 0;
    long pauses = 0;
    for (long n = 0; n < first; n++)
        pauses += frames[n % loop].len == 0;
    for (long n = 0; n < count;) {
        if (frames[(first + n) % loop].len == 0) {
            n++;
            pauses++;
            continue;
        }
        const int64_t due = start + n * period;
        if (now_ns() < due) {
            is_held = 0;
            if (wait_until(s, due, POLLIN))
                hear(s, rate_id, &heard);
            continue;
        }
        hear(s, rate_id, &heard);
        struct canfd_frame f = frames[(first + n) % loop];
        f.can_id = input_id;
        put_index(&f, (uint32_t)((first + n) * SAMPLES));
        protect(&f, (uint8_t)(first + n - pauses), data_id);
        const int64_t stamp = is_held ? due : now_ns();
        if (send(s, &f, sizeof f, MSG_DONTWAIT | MSG_NOSIGNAL) == sizeof f) {
            sent[n++] = stamp;
        } else if (errno == EAGAIN || errno == ENOBUFS) {
            if (now_ns() - due > backlog)
                n++;
            else if (wait_until(s, now_ns() + 50000, errno == EAGAIN ? POLLIN | POLLOUT : POLLIN))
                hear(s, rate_id, &heard);
            is_held = 1;
        } else {
            fail("send");
        }
    }
    heard.last = now_ns();
    while (now_ns() < heard.last + linger) {
        if (wait_until(s, heard.last + linger, POLLIN))
            hear(s, rate_id, &heard);
    }

    FILE *out = fopen(argv[11], "wb");
    const int64_t head[2] = {count, heard.count};
    if (!out || fwrite(head, sizeof head, 1, out) != 1
        || fwrite(sent, sizeof *sent, (size_t)count, out) != (size_t)count
        || fwrite(heard.rates, sizeof *heard.rates, (size_t)heard.count, out) != (size_t)heard.count
        || fclose(out) != 0)
        fail(argv[11]);
    return 0;
}
