/* Preloaded into a program: logs what it does to files of one folder, for a simulated loss of power.
 *
 * DISK_LOG names the log, DISK_FOLDER the folder. An entry: a line `op fd offset length path path2`, then `length`
 * bytes. The call itself is done first, and entries are in the order of calls of one thread. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static int log_fd = -1;
static char open_here[1024];

static void *real(const char *name) { return dlsym(RTLD_NEXT, name); }
#define REAL(result, name, ...) static result (*real_##name)(__VA_ARGS__); if (!real_##name) real_##name = real(#name)

static int inside(const char *path) {
    const char *folder = getenv("DISK_FOLDER");
    return folder && path && !strncmp(path, folder, strlen(folder));
}

static void note(const char *op, int fd, off_t offset, const void *data, size_t length, const char *one, const char *two) {
    REAL(ssize_t, write, int, const void *, size_t);
    if (log_fd < 0) {
        REAL(int, open64, const char *, int, ...);
        const char *name = getenv("DISK_LOG");
        if (!name) return;
        log_fd = real_open64(name, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    }
    char head[8192];
    int size = snprintf(head, sizeof head, "%s\t%d\t%lld\t%zu\t%s\t%s\n", op, fd, (long long)offset, length,
                        one ? one : "", two ? two : "");
    real_write(log_fd, head, size);
    if (length) real_write(log_fd, data, length);
}

static int opened(int fd, const char *path, int flags) {
    if (fd >= 0 && fd < (int)sizeof open_here && inside(path)) {
        open_here[fd] = 1;
        note(flags & O_TRUNC ? "trunc" : flags & O_CREAT ? "create" : "open", fd, 0, "", 0, path, 0);
    }
    return fd;
}

static int is_here(int fd) { return fd >= 0 && fd < (int)sizeof open_here && open_here[fd]; }

#define OPEN(name)                                                   \
    int name(const char *path, int flags, ...) {                     \
        REAL(int, name, const char *, int, ...);                     \
        va_list more; va_start(more, flags);                         \
        mode_t mode = va_arg(more, int); va_end(more);               \
        return opened(real_##name(path, flags, mode), path, flags);  \
    }
OPEN(open)
OPEN(open64)

int openat(int folder, const char *path, int flags, ...) {
    REAL(int, openat, int, const char *, int, ...);
    va_list more; va_start(more, flags);
    mode_t mode = va_arg(more, int); va_end(more);
    return opened(real_openat(folder, path, flags, mode), path, flags);
}

int close(int fd) {
    REAL(int, close, int);
    if (is_here(fd)) { open_here[fd] = 0; note("close", fd, 0, "", 0, 0, 0); }
    return real_close(fd);
}

ssize_t write(int fd, const void *data, size_t length) {
    REAL(ssize_t, write, int, const void *, size_t);
    off_t at = is_here(fd) ? lseek(fd, 0, SEEK_CUR) : 0;
    ssize_t done = real_write(fd, data, length);
    if (done > 0 && is_here(fd)) note("write", fd, at, data, done, 0, 0);
    return done;
}

#define PWRITE(name, offset_type)                                              \
    ssize_t name(int fd, const void *data, size_t length, offset_type offset) { \
        REAL(ssize_t, name, int, const void *, size_t, offset_type);           \
        ssize_t done = real_##name(fd, data, length, offset);                  \
        if (done > 0 && is_here(fd)) note("write", fd, offset, data, done, 0, 0); \
        return done;                                                           \
    }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

#define TRUNCATE(name, offset_type)                                  \
    int name(int fd, offset_type length) {                           \
        REAL(int, name, int, offset_type);                           \
        int failed = real_##name(fd, length);                        \
        if (!failed && is_here(fd)) note("resize", fd, length, "", 0, 0, 0); \
        return failed;                                               \
    }
TRUNCATE(ftruncate, off_t)
TRUNCATE(ftruncate64, off64_t)

#define SYNC(name)                                             \
    int name(int fd) {                                         \
        REAL(int, name, int);                                  \
        int failed = real_##name(fd);                          \
        if (!failed && is_here(fd)) note("sync", fd, 0, "", 0, 0, 0); \
        return failed;                                         \
    }
SYNC(fsync)
SYNC(fdatasync)

int rename(const char *from, const char *to) {
    REAL(int, rename, const char *, const char *);
    int failed = real_rename(from, to);
    if (!failed && inside(to)) note("rename", -1, 0, "", 0, from, to);
    return failed;
}

int unlink(const char *path) {
    REAL(int, unlink, const char *);
    int failed = real_unlink(path);
    if (!failed && inside(path)) note("unlink", -1, 0, "", 0, path, 0);
    return failed;
}
