/* The emulated rig: the gantry's firmware, unchanged, in front of models of its drivers and mechanics. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "board/board.h"
#include "program/cable.h"
#include "program/commands.h"
#include "program/options.h"
#include "program/pace.h"
#include "program/state.h"

static void end(int number)
{
    (void)number;
    emulator.ended = 1;
}

static void begin(void)
{
    struct stat input;
    struct sigaction action = {.sa_handler = end};
    emulator.stdin_ends = fstat(STDIN_FILENO, &input) == 0 && S_ISFIFO(input.st_mode);
    fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    emulator.base_wall = pace_clock();
}

int main(int argc, char **argv)
{
    const char *elf = options_read(argc, argv);
    if (elf == NULL) {
        fputs("rig-emulator: expected options as --help shows them, and the firmware's ELF file\n", stderr);
        return 2;
    }
    plant_start(&emulator.plant, emulator.kind, emulator.place);
    memcpy(emulator.plant.longer, emulator.longer, sizeof emulator.longer);
    memcpy(emulator.plant.shift, emulator.shift, sizeof emulator.shift);
    if (!board_start(&emulator.plant, elf, emulator.boot)) {
        fprintf(stderr, "rig-emulator: %s is not a firmware that can be read: build it with make firmware\n", elf);
        return 2;
    }
    if (emulator.memory != NULL && !board_load_memory(emulator.memory)) {
        fprintf(stderr, "rig-emulator: %s cannot be the memory: expected a file of 1024 bytes, as the EEPROM has, or a new one\n", emulator.memory);
        return 2;
    }
    begin();
    if (!commands_plug()) {
        fprintf(stderr, "rig-emulator: no pseudo terminal, or no link at %s: %s\n", emulator.link, strerror(errno));
        return 2;
    }
    pace_run();
    cable_unplug();
    if (emulator.memory != NULL && !board_save_memory(emulator.memory)) {
        fprintf(stderr, "rig-emulator: %s cannot be written: %s\n", emulator.memory, strerror(errno));
        return 1;
    }
    if (!board_crashed())
        return 0;
    fputs("rig-emulator: the controller's program ended, which it must not\n", stderr);
    return 1;
}
