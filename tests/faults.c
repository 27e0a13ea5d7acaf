/* A library to be loaded before the C library: counts the calls that change files below one folder and lets
 * the n-th fail, or ends the process before it. See faults.py for what the environment says.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static char root[PATH_MAX];
static size_t length;
static long at, calls;
static int fault, lasting, no_locks, half;
static int journal = -1; /* where each call is noted, -1 for nowhere */

/* fault: an errno, or 0 for SIGKILL; at: from 1, 0 for none; log: path or NULL */
void faults_arm(const char *folder, long number, int what, int until_the_end, const char *log)
{
    if (!realpath(folder, root))
        strncpy(root, folder, sizeof root - 1);
    length = strlen(root);
    at = number;
    fault = what;
    lasting = until_the_end;
    calls = 0;
    half = 0;
    journal = log ? syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644) : -1;
}

void faults_without_locks(int error) { no_locks = error; }

long faults_calls(void) { return calls; }

__attribute__((constructor)) static void from_environment(void)
{
    const char *folder = getenv("FAULT_ROOT"), *locks = getenv("FAULT_FLOCK");
    if (locks)
        no_locks = atoi(locks);
    if (!folder)
        return;
    const char *number = getenv("FAULT_AT"), *what = getenv("FAULT_ERRNO"), *last = getenv("FAULT_LASTING");
    faults_arm(folder, number ? atol(number) : 0, what ? atoi(what) : 0, last ? atoi(last) : 0,
               getenv("FAULT_LOG"));
}

static int inside(const char *path)
{
    return length && !strncmp(path, root, length) && (path[length] == '/' || !path[length]);
}

/* Writes the absolute name of a file to `full`; answers whether it lies in the folder. */
static int named(int folder, const char *path, char *full)
{
    full[0] = 0;
    if (!length || !path)
        return 0;
    if (path[0] != '/') {
        char link[64];
        snprintf(link, sizeof link, folder == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", folder);
        ssize_t size = readlink(link, full, PATH_MAX - 1);
        if (size < 0)
            return 0;
        snprintf(full + size, PATH_MAX - size, "/%s", path);
    } else
        snprintf(full, PATH_MAX, "%s", path);
    return inside(full);
}

static int opened(int handle, char *full)
{
    char link[64];
    full[0] = 0;
    if (!length)
        return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", handle);
    ssize_t size = readlink(link, full, PATH_MAX - 1);
    if (size < 0)
        return 0;
    full[size] = 0;
    return inside(full);
}

/* Counts one call; answers whether it must fail, with errno set. A full disk hinders only what needs space. */
static int hit(const char *name, const char *path, int needs_space)
{
    calls++;
    if (journal >= 0) {
        char line[PATH_MAX + 64];
        int size = snprintf(line, sizeof line, "%ld %s %s\n", calls, name, path + length + !!path[length]);
        syscall(SYS_write, journal, line, size);
    }
    if (!at || calls < at || (calls > at && !lasting))
        return 0;
    if (!fault) {
        kill(getpid(), SIGKILL);
        pause();
    }
    if (calls > at && fault == ENOSPC && !needs_space)
        return 0;
    errno = fault;
    return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define ONE(type, name, parameters, folder, path, space, arguments)      \
    type name parameters                                                 \
    {                                                                    \
        char full[PATH_MAX];                                             \
        int saved = errno;                                               \
        if (named(folder, path, full) && hit(#name, full, space))        \
            return -1;                                                   \
        errno = saved;                                                   \
        return REAL(name) arguments;                                     \
    }
#define HANDLE(type, name, parameters, handle, space, arguments)         \
    type name parameters                                                 \
    {                                                                    \
        char full[PATH_MAX];                                             \
        int saved = errno;                                               \
        if (opened(handle, full) && hit(#name, full, space))             \
            return -1;                                                   \
        errno = saved;                                                   \
        return REAL(name) arguments;                                     \
    }

ONE(int, rename, (const char *from, const char *to), AT_FDCWD, to, 1, (from, to))
ONE(int, renameat, (int a, const char *from, int b, const char *to), b, to, 1, (a, from, b, to))
ONE(int, renameat2, (int a, const char *from, int b, const char *to, unsigned flags), b, to, 1,
    (a, from, b, to, flags))
ONE(int, unlink, (const char *path), AT_FDCWD, path, 0, (path))
ONE(int, unlinkat, (int folder, const char *path, int flags), folder, path, 0, (folder, path, flags))
ONE(int, rmdir, (const char *path), AT_FDCWD, path, 0, (path))
ONE(int, mkdir, (const char *path, mode_t mode), AT_FDCWD, path, 1, (path, mode))
ONE(int, mkdirat, (int folder, const char *path, mode_t mode), folder, path, 1, (folder, path, mode))
ONE(int, link, (const char *from, const char *to), AT_FDCWD, to, 1, (from, to))
ONE(int, linkat, (int a, const char *from, int b, const char *to, int flags), b, to, 1, (a, from, b, to, flags))
ONE(int, symlink, (const char *from, const char *to), AT_FDCWD, to, 1, (from, to))
ONE(int, symlinkat, (const char *from, int folder, const char *to), folder, to, 1, (from, folder, to))
ONE(int, truncate, (const char *path, off_t size), AT_FDCWD, path, 0, (path, size))
ONE(int, truncate64, (const char *path, off64_t size), AT_FDCWD, path, 0, (path, size))
ONE(int, chmod, (const char *path, mode_t mode), AT_FDCWD, path, 0, (path, mode))
HANDLE(int, fchmod, (int handle, mode_t mode), handle, 0, (handle, mode))
HANDLE(int, ftruncate, (int handle, off_t size), handle, 0, (handle, size))
HANDLE(int, ftruncate64, (int handle, off64_t size), handle, 0, (handle, size))
HANDLE(int, fsync, (int handle), handle, 0, (handle))
HANDLE(int, fdatasync, (int handle), handle, 0, (handle))
HANDLE(ssize_t, pwrite, (int handle, const void *data, size_t size, off_t place), handle, 1,
       (handle, data, size, place))
HANDLE(ssize_t, pwrite64, (int handle, const void *data, size_t size, off64_t place), handle, 1,
       (handle, data, size, place))
HANDLE(ssize_t, writev, (int handle, const struct iovec *parts, int count), handle, 1, (handle, parts, count))
HANDLE(ssize_t, sendfile, (int to, int from, off_t *place, size_t size), to, 1, (to, from, place, size))
HANDLE(ssize_t, sendfile64, (int to, int from, off64_t *place, size_t size), to, 1, (to, from, place, size))
HANDLE(ssize_t, copy_file_range, (int from, off64_t *a, int to, off64_t *b, size_t size, unsigned flags), to, 1,
       (from, a, to, b, size, flags))

/* As on a disk that fills: what fits is written and counted, and the next write has no space. */
ssize_t write(int handle, const void *data, size_t size)
{
    char full[PATH_MAX];
    int saved = errno;
    if (handle > 2 && handle != journal && opened(handle, full)) {
        if (half) {
            half = 0;
            errno = fault;
            return -1;
        }
        if (hit("write", full, 1)) {
            if (fault == ENOSPC && size > 1) {
                half = !lasting;
                return REAL(write)(handle, data, size / 2);
            }
            return -1;
        }
    }
    errno = saved;
    return REAL(write)(handle, data, size);
}

static int creating(const char *path, int folder, int flags, char *full)
{
    struct stat entry;
    return (flags & O_CREAT) && named(folder, path, full) && fstatat(folder, path, &entry, AT_SYMLINK_NOFOLLOW);
}

#define OPEN(name)                                                       \
    int name(const char *path, int flags, ...)                           \
    {                                                                    \
        char full[PATH_MAX];                                             \
        int saved = errno;                                               \
        va_list more;                                                    \
        va_start(more, flags);                                           \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more);                                                    \
        if (creating(path, AT_FDCWD, flags, full) && hit("create", full, 1)) \
            return -1;                                                   \
        errno = saved;                                                   \
        return REAL(name)(path, flags, mode);                            \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                     \
    int name(int folder, const char *path, int flags, ...)               \
    {                                                                    \
        char full[PATH_MAX];                                             \
        int saved = errno;                                               \
        va_list more;                                                    \
        va_start(more, flags);                                           \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more);                                                    \
        if (creating(path, folder, flags, full) && hit("create", full, 1)) \
            return -1;                                                   \
        errno = saved;                                                   \
        return REAL(name)(folder, path, flags, mode);                    \
    }
OPENAT(openat)
OPENAT(openat64)

int flock(int handle, int operation)
{
    if (no_locks) {
        errno = no_locks;
        return -1;
    }
    return REAL(flock)(handle, operation);
}
