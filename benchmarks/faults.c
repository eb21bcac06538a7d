/* Faults in file operations, below Python and HDF5: loaded before the C library (LD_PRELOAD), by all processes of a run.

   Operations on files whose path holds `under` are counted in memory that all processes share. From operation `at` on
   (only that one where not `lasting`) they fail with `error`, write half of what they are to write, or kill the whole
   process group, before the operation or in the middle of a write. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { FAIL = 1, SHORT = 2, KILL = 3, TORN = 4 };

static struct {
    long count, at, mode, error, lasting, fired;
    char under[256];
} *state;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("FAULTS_STATE");
    int file = path ? (int)syscall(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC, 0) : -1;
    void *shared = file < 0 ? MAP_FAILED : mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    state = shared == MAP_FAILED ? NULL : shared;
    if (file >= 0) syscall(SYS_close, file);
}

/* The fault that is due at an operation on a path, 0 for none. */
static long due(const char *path) {
    if (!state || !state->under[0] || !path || !strstr(path, state->under)) return 0;
    long number = __atomic_add_fetch(&state->count, 1, __ATOMIC_SEQ_CST);
    if (!state->at || number < state->at || (number > state->at && !state->lasting)) return 0;
    if (state->mode == FAIL || state->mode == KILL) state->fired = 1;
    if (state->mode == KILL) kill(0, SIGKILL), pause();
    errno = (int)state->error;
    return state->mode;
}

static long due_at(int file) {
    char link[64], path[4096];
    if (!state || !state->under[0]) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    long length = syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return due(path);
}

#define NEXT(name) static __typeof__(&name) next; if (!next) next = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

#define OPEN(name)                                                                   \
    int name(const char *path, int flags, ...) {                                     \
        NEXT(name);                                                                  \
        va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
        return due(path) == FAIL ? -1 : next(path, flags, mode);                     \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                 \
    int name(int folder, const char *path, int flags, ...) {                         \
        NEXT(name);                                                                  \
        va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
        return due(path) == FAIL ? -1 : next(folder, path, flags, mode);             \
    }
OPENAT(openat)
OPENAT(openat64)

#define ON_PATH(type, failed, name, declared, used)                                  \
    type name declared { NEXT(name); return due(path) == FAIL ? failed : next used; }
ON_PATH(int, -1, mkdir, (const char *path, mode_t mode), (path, mode))
ON_PATH(int, -1, rmdir, (const char *path), (path))
ON_PATH(int, -1, unlink, (const char *path), (path))
ON_PATH(int, -1, rename, (const char *path, const char *to), (path, to))
ON_PATH(int, -1, link, (const char *path, const char *to), (path, to))
ON_PATH(DIR *, NULL, opendir, (const char *path), (path))

#define ON_FILE(type, name, declared, used)                                          \
    type name declared { NEXT(name); return due_at(file) == FAIL ? -1 : next used; }
ON_FILE(ssize_t, read, (int file, void *to, size_t size), (file, to, size))
ON_FILE(ssize_t, pread, (int file, void *to, size_t size, off_t from), (file, to, size, from))
ON_FILE(ssize_t, pread64, (int file, void *to, size_t size, off64_t from), (file, to, size, from))
ON_FILE(int, fsync, (int file), (file))
ON_FILE(int, ftruncate, (int file, off_t size), (file, size))
ON_FILE(int, ftruncate64, (int file, off64_t size), (file, size))
ON_FILE(int, flock, (int file, int how), (file, how))
ON_FILE(int, fchmod, (int file, mode_t mode), (file, mode))

#define WRITE(name, declared, whole, half)                                           \
    ssize_t name declared {                                                          \
        NEXT(name);                                                                  \
        long fault = due_at(file);                                                   \
        if (fault == FAIL) return -1;                                                \
        if ((fault == SHORT || fault == TORN) && size > 1) {                         \
            ssize_t done = next half;                                                \
            state->fired = 1;                                                        \
            if (fault == TORN) kill(0, SIGKILL), pause();                            \
            return done;                                                             \
        }                                                                            \
        return next whole;                                                           \
    }
WRITE(write, (int file, const void *from, size_t size), (file, from, size), (file, from, size / 2))
WRITE(pwrite, (int file, const void *from, size_t size, off_t at), (file, from, size, at), (file, from, size / 2, at))
WRITE(pwrite64, (int file, const void *from, size_t size, off64_t at), (file, from, size, at), (file, from, size / 2, at))

int close(int file) {
    NEXT(close);
    long fault = due_at(file);
    int error = errno, done = next(file);
    if (fault == FAIL) return errno = error, -1;
    return done;
}
