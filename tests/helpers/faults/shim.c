/* A library that is loaded before libc and lets single calls fail that touch one folder.

   The file named by FAULTS_STATE is shared by all processes of a test. It holds which call fails and how often each
   was made. FAULTS_FOLDER is the folder. Without this library only Python's own calls could be made to fail, but HDF5
   writes by itself. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum { OPEN, WRITE, PWRITE, FTRUNCATE, RENAME, FSYNC, MKDIR, UNLINK, LINK, FLOCK, CALLS };

/* The call that fails, -1 for none; its number from 1; 1 if all later ones fail, too; the error; calls so far. */
struct state {
  int call, number, onward, error, counts[CALLS];
};
static struct state *state;
static char folder[PATH_MAX];

__attribute__((constructor)) static void begin(void) {
  const char *path = getenv("FAULTS_STATE"), *named = getenv("FAULTS_FOLDER");
  int file = path && named ? open(path, O_RDWR) : -1;
  if (file < 0) return;
  void *memory = mmap(NULL, sizeof(struct state), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  snprintf(folder, sizeof folder, "%s", named);
  if (memory != MAP_FAILED) state = memory;
}

static int inside(const char *path) {
  size_t length = strlen(folder);
  return !strncmp(path, folder, length) && (path[length] == '/' || !path[length]);
}

static int of_file(int file) {
  char name[64], target[PATH_MAX];
  snprintf(name, sizeof name, "/proc/self/fd/%d", file);
  ssize_t length = readlink(name, target, sizeof target - 1);
  if (length < 0) return 0;
  target[length] = 0;
  return inside(target);
}

static int of_path(int directory, const char *path) {
  char whole[2 * PATH_MAX], present[PATH_MAX];
  if (!path) return 0;
  if (path[0] == '/') return inside(path);
  if (directory != AT_FDCWD) return of_file(directory);
  if (!getcwd(present, sizeof present)) return 0;
  snprintf(whole, sizeof whole, "%s/%s", present, path);
  return inside(whole);
}

/* True if this call fails; it sets errno. */
static int fails(int call, int touches) {
  if (!state || !touches) return 0;
  int number = __sync_add_and_fetch(&state->counts[call], 1);
  if (state->call != call || number < state->number || (number > state->number && !state->onward)) return 0;
  errno = state->error;
  return 1;
}

#define WRAP(result, name, call, touches, declared, given) \
  result name declared { \
    int before = errno; \
    if (fails(call, state && (touches))) return -1; \
    errno = before; \
    return ((result(*) declared)dlsym(RTLD_NEXT, #name))given; \
  }
#define MODE \
  mode_t mode = 0; \
  if (flags & (O_CREAT | O_TMPFILE)) { \
    va_list rest; \
    va_start(rest, flags); \
    mode = va_arg(rest, mode_t); \
    va_end(rest); \
  }
#define OPENS(name) \
  int name(const char *path, int flags, ...) { \
    MODE \
    int before = errno; \
    if (fails(OPEN, state && of_path(AT_FDCWD, path))) return -1; \
    errno = before; \
    return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, #name))(path, flags, mode); \
  }
#define OPENS_AT(name) \
  int name(int directory, const char *path, int flags, ...) { \
    MODE \
    int before = errno; \
    if (fails(OPEN, state && of_path(directory, path))) return -1; \
    errno = before; \
    return ((int (*)(int, const char *, int, ...))dlsym(RTLD_NEXT, #name))(directory, path, flags, mode); \
  }

OPENS(open)
OPENS(open64)
OPENS_AT(openat)
OPENS_AT(openat64)
WRAP(int, __open_2, OPEN, of_path(AT_FDCWD, path), (const char *path, int flags), (path, flags))
WRAP(int, __open64_2, OPEN, of_path(AT_FDCWD, path), (const char *path, int flags), (path, flags))
WRAP(ssize_t, write, WRITE, of_file(file), (int file, const void *bytes, size_t size), (file, bytes, size))
WRAP(ssize_t, writev, WRITE, of_file(file), (int file, const struct iovec *parts, int count), (file, parts, count))
WRAP(ssize_t, pwrite, PWRITE, of_file(file), (int file, const void *bytes, size_t size, off_t place),
     (file, bytes, size, place))
WRAP(ssize_t, pwrite64, PWRITE, of_file(file), (int file, const void *bytes, size_t size, off64_t place),
     (file, bytes, size, place))
WRAP(int, ftruncate, FTRUNCATE, of_file(file), (int file, off_t size), (file, size))
WRAP(int, ftruncate64, FTRUNCATE, of_file(file), (int file, off64_t size), (file, size))
WRAP(int, rename, RENAME, of_path(AT_FDCWD, path) || of_path(AT_FDCWD, target), (const char *path, const char *target),
     (path, target))
WRAP(int, renameat, RENAME, of_path(from, path) || of_path(to, target),
     (int from, const char *path, int to, const char *target), (from, path, to, target))
WRAP(int, fsync, FSYNC, of_file(file), (int file), (file))
WRAP(int, fdatasync, FSYNC, of_file(file), (int file), (file))
WRAP(int, mkdir, MKDIR, of_path(AT_FDCWD, path), (const char *path, mode_t mode), (path, mode))
WRAP(int, mkdirat, MKDIR, of_path(directory, path), (int directory, const char *path, mode_t mode),
     (directory, path, mode))
WRAP(int, unlink, UNLINK, of_path(AT_FDCWD, path), (const char *path), (path))
WRAP(int, unlinkat, UNLINK, of_path(directory, path), (int directory, const char *path, int flags),
     (directory, path, flags))
WRAP(int, link, LINK, of_path(AT_FDCWD, path) || of_path(AT_FDCWD, target), (const char *path, const char *target),
     (path, target))
WRAP(int, linkat, LINK, of_path(from, path) || of_path(to, target),
     (int from, const char *path, int to, const char *target, int flags), (from, path, to, target, flags))
WRAP(int, flock, FLOCK, of_file(file), (int file, int operation), (file, operation))
