/* CAN FD frames on a SocketCAN interface or on a socket that was handed over. */
#ifndef FRAMES_H
#define FRAMES_H

#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { INDEX_AT = 4, COUNTER_AT = 2, RECEIVE_BUFFER = 16 << 20 };

static inline int64_t clock_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

#ifdef __x86_64__
/* In user-mode Linux asking the clock is a system call, which takes longer than what is to be measured. */
static double ns_a_tick = 0.0;
static uint64_t first_tick;

static inline void start_clock(void)
{
    const int64_t begin = clock_ns();
    first_tick = __builtin_ia32_rdtsc();
    while (clock_ns() < begin + 50000000)
        ;
    ns_a_tick = (double)(clock_ns() - begin) / (double)(__builtin_ia32_rdtsc() - first_tick);
}

static inline int64_t now_ns(void)
{
    return (int64_t)((double)(__builtin_ia32_rdtsc() - first_tick) * ns_a_tick) + 1;
}
#else
static inline void start_clock(void) {}

static inline int64_t now_ns(void)
{
    return clock_ns();
}
#endif

static inline void fail(const char *what)
{
    perror(what);
    exit(1);
}

static inline uint32_t get_index(const struct canfd_frame *f)
{
    uint32_t index;
    memcpy(&index, f->data + INDEX_AT, sizeof index);
    return index;
}

static inline void put_index(struct canfd_frame *f, uint32_t index)
{
    memcpy(f->data + INDEX_AT, &index, sizeof index);
}

/* `fd:5`: descriptor 5; else the name of an interface, of which only frames of `wanted` are received. */
static inline int open_frames(const char *link, canid_t wanted)
{
    if (strncmp(link, "fd:", 3) == 0)
        return atoi(link + 3);
    int s = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (s < 0)
        fail("socket");
    int on = 1, size = RECEIVE_BUFFER;
    struct can_filter filter = {wanted, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = if_nametoindex(link)};
    if (setsockopt(s, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) < 0
        || setsockopt(s, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter) < 0)
        fail("setsockopt");
    if (setsockopt(s, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) < 0)
        setsockopt(s, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    if (bind(s, (struct sockaddr *)&address, sizeof address) < 0)
        fail(link);
    return s;
}

#endif
