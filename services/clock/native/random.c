/* Randomness: each thread draws its own numbers, from the seed of the test and from which thread it is. */
#define _GNU_SOURCE
#include "library.h"

#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

enum { FILE_BYTES = 1 << 16, SOURCE_MODE = 01446 /* which no other file has */ };

static uint64_t mixed(uint64_t value)
{
    value = (value ^ value >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    value = (value ^ value >> 27) * UINT64_C(0x94d049bb133111eb);
    return value ^ value >> 31;
}

static uint64_t next(void)
{
    uint64_t who = (uint64_t)process.service << 48 | (uint64_t)process.number << 24 | (self.slot ? self.slot->thread : 0);
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
    return (uint32_t)((uint64_t)arc4random() * bound >> 32);
}

/* std::random_device, which may ask the processor instead of the kernel. */
PUBLIC unsigned _ZNSt13random_device9_M_getvalEv(void *device)
{
    (void)device;
    return arc4random();
}

/* -- /dev/urandom: a file of drawn bytes, without an end for `read` ------------------------------------------------------- */

/* Known by its mode, not by its number: libc closes files without a word, and programs copy descriptors. */
bool is_random_file(int file)
{
    struct stat found;
    return page && page->sources && !fstat(file, &found) && found.st_mode == (S_IFREG | SOURCE_MODE) && !found.st_nlink;
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
    RAW_2(SYS_fchmod, file, SOURCE_MODE);
    page->sources++;
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

PUBLIC int __open_2(const char *path, int flags)
{
    return open_at(AT_FDCWD, path, flags, 0);
}

PUBLIC int __openat_2(int folder, const char *path, int flags)
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

/* With 64 bits these are the same. */
ALIAS(open64, open);
ALIAS(openat64, openat);
ALIAS(__open64_2, __open_2);
ALIAS(__openat64_2, __openat_2);
ALIAS(fopen64, fopen);
