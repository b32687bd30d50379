/* Randomness: each thread draws its own numbers, from the seed of the test and from which thread it is. */
#define _GNU_SOURCE
#include "library.h"

#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>

enum { RANDOM_FILES = 1024, FILE_BYTES = 1 << 16 };

static _Atomic bool is_random[RANDOM_FILES];

static uint64_t mixed(uint64_t value)
{
    value = (value ^ value >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    value = (value ^ value >> 27) * UINT64_C(0x94d049bb133111eb);
    return value ^ value >> 31;
}

static uint64_t next(void)
{
    uint64_t who = (uint64_t)own_service() << 48 | (uint64_t)own_process() << 24 | (self.slot ? self.slot->thread : 0);
    uint64_t seed = mixed(page->seed + UINT64_C(0x9e3779b97f4a7c15)) ^ mixed(who + 1);
    return mixed(seed + UINT64_C(0x9e3779b97f4a7c15) * ++self.drawn);
}

void draw(void *bytes, size_t size)
{
    char *at = bytes;
    while (size) {
        uint64_t value = next();
        size_t part = size < sizeof value ? size : sizeof value;
        memcpy(at, &value, part);
        at += part;
        size -= part;
    }
}

PUBLIC ssize_t getrandom(void *bytes, size_t size, unsigned flags)
{
    if (!is_managed())
        return answer(RAW_3(SYS_getrandom, bytes, size, flags));
    draw(bytes, size);
    return (ssize_t)size;
}

PUBLIC int getentropy(void *bytes, size_t size)
{
    if (size > 256)
        return fail_with(EIO);
    return getrandom(bytes, size, 0) == (ssize_t)size ? 0 : -1;
}

PUBLIC void arc4random_buf(void *bytes, size_t size)
{
    getrandom(bytes, size, 0);
}

PUBLIC uint32_t arc4random(void)
{
    uint32_t value = 0;
    getrandom(&value, sizeof value, 0);
    return value;
}

PUBLIC uint32_t arc4random_uniform(uint32_t bound)
{
    uint32_t lowest = bound < 2 ? 0 : -bound % bound, value; /* below that, some numbers would come more often */
    do
        value = arc4random();
    while (value < lowest);
    return bound < 2 ? 0 : value % bound;
}

/* std::random_device, which may ask the processor instead of the kernel. */
PUBLIC unsigned _ZNSt13random_device9_M_getvalEv(void *device)
{
    (void)device;
    return arc4random();
}

/* -- /dev/urandom: a file of drawn bytes, without an end for `read` ------------------------------------------------------- */

bool is_random_file(int file)
{
    return file >= 0 && file < RANDOM_FILES && is_random[file];
}

void forget_random_file(int file)
{
    if (is_random_file(file))
        is_random[file] = false;
}

static bool is_source(const char *path)
{
    return !strcmp(path, "/dev/urandom") || !strcmp(path, "/dev/random");
}

static int open_source(int flags)
{
    char bytes[FILE_BYTES];
    int file = (int)answer(RAW_2(SYS_memfd_create, "random", flags & O_CLOEXEC ? MFD_CLOEXEC : 0));
    if (file < 0)
        return -1;
    draw(bytes, sizeof bytes);
    RAW_4(SYS_pwrite64, file, bytes, sizeof bytes, 0);
    if (file < RANDOM_FILES)
        is_random[file] = true;
    return file;
}

static int open_at(int folder, const char *path, int flags, mode_t mode)
{
    if (is_source(path) && is_managed())
        return open_source(flags);
    return (int)answer(RAW_4(SYS_openat, folder, path, flags, mode));
}

#define MODE(flags)                                                                                                     \
    mode_t mode = 0;                                                                                                    \
    if ((flags) & O_CREAT || ((flags) & O_TMPFILE) == O_TMPFILE) {                                                      \
        va_list arguments;                                                                                              \
        va_start(arguments, flags);                                                                                     \
        mode = va_arg(arguments, mode_t);                                                                               \
        va_end(arguments);                                                                                              \
    }

PUBLIC int open(const char *path, int flags, ...)
{
    MODE(flags)
    return open_at(AT_FDCWD, path, flags, mode);
}

PUBLIC int openat(int folder, const char *path, int flags, ...)
{
    MODE(flags)
    return open_at(folder, path, flags, mode);
}

PUBLIC int open64(const char *path, int flags, ...)
{
    MODE(flags)
    return open_at(AT_FDCWD, path, flags, mode);
}

PUBLIC int openat64(int folder, const char *path, int flags, ...)
{
    MODE(flags)
    return open_at(folder, path, flags, mode);
}

PUBLIC int __open_2(const char *path, int flags)
{
    return open_at(AT_FDCWD, path, flags, 0);
}

PUBLIC int __open64_2(const char *path, int flags)
{
    return open_at(AT_FDCWD, path, flags, 0);
}

PUBLIC int __openat_2(int folder, const char *path, int flags)
{
    return open_at(folder, path, flags, 0);
}

PUBLIC int __openat64_2(int folder, const char *path, int flags)
{
    return open_at(folder, path, flags, 0);
}

PUBLIC FILE *fopen(const char *restrict path, const char *restrict how)
{
    if (!is_managed())
        return errno = EAGAIN, NULL;
    if (!is_source(path))
        return real.fopen(path, how);
    int file = open_source(strchr(how, 'e') ? O_CLOEXEC : 0);
    return file < 0 ? NULL : fdopen(file, how);
}

PUBLIC FILE *fopen64(const char *restrict path, const char *restrict how)
{
    return is_source(path) ? fopen(path, how) : is_managed() ? real.fopen64(path, how) : NULL;
}
