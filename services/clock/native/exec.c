/* Programs that a process executes get the library and the test's time whatever environment they are given.
 *
 * What cannot be preloaded, a static or set-uid program, is noted in the test's result.
 */
#define _GNU_SOURCE
#include "library.h"

#include <elf.h>
#include <fcntl.h>
#include <stdarg.h>
#include <string.h>
#include <sys/stat.h>

enum { MOST_PROGRAM_HEADERS = 64, MOST_INTERPRETERS = 4 };

extern char **environ;

/* -- what cannot be preloaded --------------------------------------------------------------------------------------- */

static bool is_static(int file, const Elf64_Ehdr *header)
{
    Elf64_Phdr each;
    if (memcmp(header->e_ident, ELFMAG, SELFMAG) != 0 || header->e_ident[EI_CLASS] != ELFCLASS64)
        return false;
    for (int at = 0; at < header->e_phnum && at < MOST_PROGRAM_HEADERS; at++)
        if (RAW_4(SYS_pread64, file, &each, sizeof each, header->e_phoff + (uint64_t)at * sizeof each) != sizeof each
            || each.p_type == PT_INTERP)
            return false;
    return true;
}

/* The interpreter that a script names in its first line, in `path`. */
static bool is_script(const char *text, char *path, size_t size)
{
    if (strncmp(text, "#!", 2) != 0)
        return false;
    text += 2 + strspn(text + 2, " \t");
    size_t length = strcspn(text, " \t\n");
    if (!length || length >= size)
        return false;
    memcpy(path, text, length);
    path[length] = 0;
    return true;
}

static void inspect(const char *given)
{
    union { char text[512]; Elf64_Ehdr header; } begin;
    char path[PATH_MAX];
    strncpy(path, given, sizeof path - 1);
    path[sizeof path - 1] = 0;
    for (int at = 0; at < MOST_INTERPRETERS; at++) {
        struct stat found;
        memset(&begin, 0, sizeof begin);
        int file = (int)RAW_4(SYS_openat, AT_FDCWD, path, O_RDONLY | O_CLOEXEC, 0);
        if (file < 0)
            return;
        bool is_read = RAW_3(SYS_read, file, begin.text, sizeof begin - 1) > 0 && !fstat(file, &found);
        if (is_read && (found.st_mode & S_ISUID) && found.st_uid != geteuid())
            note(TIME_NOTE_SETUID, path);
        else if (is_read && is_static(file, &begin.header))
            note(TIME_NOTE_STATIC, path);
        RAW_1(SYS_close, file);
        if (!is_read || !is_script(begin.text, path, sizeof path))
            return;
    }
}

static void inspect_in_path(const char *name)
{
    const char *folders = getenv("PATH");
    char path[PATH_MAX];
    if (strchr(name, '/')) {
        inspect(name);
        return;
    }
    for (const char *at = folders ? folders : "/bin:/usr/bin"; *at; at += strspn(at, ":")) {
        int length = (int)strcspn(at, ":");
        snprintf(path, sizeof path, "%.*s/%s", length, at, name);
        if (!access(path, X_OK)) {
            inspect(path);
            return;
        }
        at += length;
    }
}

/* -- the environment ------------------------------------------------------------------------------------------------ */

enum { OURS = 4, LONGEST = PATH_MAX + 4096 };

static bool is_named(const char *entry, const char *name)
{
    size_t length = strlen(name);
    return !strncmp(entry, name, length) && entry[length] == '=';
}

struct environment {
    char preload[LONGEST], folder[512], service[64], process[64];
};

/* `given` with our variables in it, in `result`, which has room for OURS + 1 more. `of` is 0 in a process to come. */
static void add_ours(char *const *given, char **result, struct environment *ours, uint32_t number, int of)
{
    const char *theirs = NULL;
    size_t count = 0;
    for (; given && *given; given++) {
        if (is_named(*given, "LD_PRELOAD"))
            theirs = *given + strlen("LD_PRELOAD=");
        else if (!is_named(*given, "DODO_TIME") && !is_named(*given, "DODO_TIME_SERVICE")
                 && !is_named(*given, "DODO_TIME_PROCESS"))
            result[count++] = *given;
    }
    bool has_ours = theirs && strstr(theirs, process.library);
    if (has_ours)
        snprintf(ours->preload, sizeof ours->preload, "LD_PRELOAD=%s", theirs);
    else
        snprintf(ours->preload, sizeof ours->preload, "LD_PRELOAD=%s%s%s", process.library, theirs && *theirs ? ":" : "",
                 theirs ? theirs : "");
    snprintf(ours->folder, sizeof ours->folder, "DODO_TIME=%s", process.folder);
    snprintf(ours->service, sizeof ours->service, "DODO_TIME_SERVICE=%u", process.service);
    snprintf(ours->process, sizeof ours->process, "DODO_TIME_PROCESS=%u:%d", number, of);
    result[count++] = ours->preload;
    result[count++] = ours->folder;
    result[count++] = ours->service;
    result[count++] = ours->process;
    result[count] = NULL;
}

static size_t count_of(char *const *words)
{
    size_t count = 0;
    while (words && words[count])
        count++;
    return count;
}

#define WITH_OURS(given, number, of)                                                                                    \
    struct environment ours;                                                                                            \
    char *complete[count_of(given) + OURS + 1];                                                                         \
    add_ours(given, complete, &ours, number, of)

/* -- exec ----------------------------------------------------------------------------------------------------------- */

PUBLIC int execve(const char *path, char *const words[], char *const environment[])
{
    if (!is_managed())
        return (int)answer(RAW_3(SYS_execve, path, words, environment));
    inspect(path);
    WITH_OURS(environment, process.number, getpid());
    return real.execve(path, words, complete);
}

PUBLIC int execvpe(const char *name, char *const words[], char *const environment[])
{
    if (!is_managed())
        return fail_with(EAGAIN);
    inspect_in_path(name);
    WITH_OURS(environment, process.number, getpid());
    return real.execvpe(name, words, complete);
}

PUBLIC int fexecve(int file, char *const words[], char *const environment[])
{
    char path[64];
    if (!is_managed())
        return fail_with(EAGAIN);
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    inspect(path);
    WITH_OURS(environment, process.number, getpid());
    return real.fexecve(file, words, complete);
}

PUBLIC int execv(const char *path, char *const words[])
{
    return execve(path, words, environ);
}

PUBLIC int execvp(const char *name, char *const words[])
{
    return execvpe(name, words, environ);
}

/* The words of a list of arguments up to NULL, and with `execle` the environment behind it. */
#define COLLECT(first)                                                                                                  \
    va_list arguments;                                                                                                  \
    size_t count = 1;                                                                                                   \
    va_start(arguments, first);                                                                                         \
    while (va_arg(arguments, char *))                                                                                   \
        count++;                                                                                                        \
    va_end(arguments);                                                                                                  \
    char *words[count + 1];                                                                                             \
    words[0] = (char *)(uintptr_t)first;                                                                                \
    va_start(arguments, first);                                                                                         \
    for (size_t at = 1; at <= count; at++)                                                                              \
        words[at] = va_arg(arguments, char *)

PUBLIC int execl(const char *path, const char *first, ...)
{
    COLLECT(first);
    va_end(arguments);
    return execv(path, words);
}

PUBLIC int execlp(const char *name, const char *first, ...)
{
    COLLECT(first);
    va_end(arguments);
    return execvp(name, words);
}

PUBLIC int execle(const char *path, const char *first, ...)
{
    COLLECT(first);
    char *const *environment = va_arg(arguments, char *const *);
    va_end(arguments);
    return execve(path, words, environment);
}

#define SPAWN(name, look)                                                                                               \
    PUBLIC int name(pid_t *restrict pid, const char *restrict program,                                                 \
                    const posix_spawn_file_actions_t *restrict actions, const posix_spawnattr_t *restrict attributes,  \
                    char *const words[restrict], char *const environment[restrict])                                    \
    {                                                                                                                  \
        if (!is_managed())                                                                                             \
            return EAGAIN;                                                                                             \
        look(program);                                                                                                 \
        WITH_OURS(environment, next_process_number(), 0);                                                              \
        pid_t child = 0;                                                                                               \
        int error = real.name(&child, program, actions, attributes, words, complete);                                  \
        add_child(child);                                                                                              \
        if (pid && !error)                                                                                             \
            *pid = child;                                                                                              \
        return error;                                                                                                  \
    }
SPAWN(posix_spawn, inspect)
SPAWN(posix_spawnp, inspect_in_path)
