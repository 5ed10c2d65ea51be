/* A bus in user space: a frame that comes from one socket goes to all others of its group, once a millisecond, as
 * adapters hand over what came meanwhile.
 *
 * usage: hub GROUP...
 *
 * GROUP: numbers of sockets that were handed over, by commas. Frames that a socket has no room for wait here, as many
 * as a SocketCAN buffer of 16 MiB holds; what comes on top of them is lost to it. For every byte on stdin a line says
 * how many were lost, by socket: `NUMBER LOST ...`. It ends with stdin.
 */
#define _GNU_SOURCE
#include "frames.h"

#include <poll.h>

enum { MOST = 64, ROOM = 20000, AT_ONCE = 256, PAUSE_US = 1000 };

struct end {
    int s, group;
    long first, waiting, lost;
    struct canfd_frame *queue;
};

static int try_to_send(const struct end *to, const struct canfd_frame *f)
{
    return send(to->s, f, sizeof *f, MSG_DONTWAIT | MSG_NOSIGNAL) == sizeof *f;
}

static void give(struct end *to, const struct canfd_frame *f)
{
    if (to->waiting == 0 && try_to_send(to, f))
        return;
    if (to->waiting == ROOM)
        to->lost++;
    else
        to->queue[(to->first + to->waiting++) % ROOM] = *f;
}

static void give_what_waits(struct end *to)
{
    while (to->waiting > 0 && try_to_send(to, &to->queue[to->first])) {
        to->first = (to->first + 1) % ROOM;
        to->waiting--;
    }
}

static void take(struct end *ends, int count, const struct end *from)
{
    struct canfd_frame f;
    for (int n = 0; n < AT_ONCE && recv(from->s, &f, sizeof f, MSG_DONTWAIT) == sizeof f; n++)
        for (int i = 0; i < count; i++)
            if (ends[i].group == from->group && &ends[i] != from)
                give(&ends[i], &f);
}

static int ask(const struct end *ends, int count)
{
    char byte;
    if (read(STDIN_FILENO, &byte, 1) != 1)
        return 0;
    for (int i = 0; i < count; i++)
        printf("%d %ld ", ends[i].s, ends[i].lost);
    printf("\n");
    fflush(stdout);
    return 1;
}

int main(int argc, char **argv)
{
    struct end ends[MOST] = {0};
    struct pollfd wanted[MOST + 1];
    int count = 0;
    for (int group = 1; group < argc; group++)
        for (char *word = strtok(argv[group], ","); word && count < MOST; word = strtok(NULL, ",")) {
            ends[count] = (struct end){.s = atoi(word), .group = group};
            ends[count].queue = malloc(ROOM * sizeof *ends[count].queue);
            if (!ends[count++].queue)
                fail("memory");
        }
    for (;;) {
        for (int i = 0; i < count; i++)
            wanted[i] = (struct pollfd){ends[i].s, ends[i].waiting ? POLLIN | POLLOUT : POLLIN, 0};
        wanted[count] = (struct pollfd){STDIN_FILENO, POLLIN, 0};
        if (poll(wanted, (nfds_t)count + 1, -1) < 0 && errno != EINTR)
            fail("poll");
        for (int i = 0; i < count; i++) {
            if (wanted[i].revents & POLLOUT)
                give_what_waits(&ends[i]);
            if (wanted[i].revents & POLLIN)
                take(ends, count, &ends[i]);
        }
        if (wanted[count].revents && !ask(ends, count))
            return 0;
        usleep(PAUSE_US);
    }
}
