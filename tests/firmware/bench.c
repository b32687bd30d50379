/* The firmware's core on a host, with the models of drivers and mechanics; time passes only on command.
 *
 * Commands on standard input, a line each: `send HEX` sends bytes to the core, `run S` lets time pass, `pass S` lets it
 * pass while the core is busy, `wraps S` makes the core's clock wrap around in S seconds, `restart` resets the
 * controller, `memory blank`, `memory cut N` (the power fails in the write after N more, until `restart`), `memory flip
 * ADDRESS BITS`, `quit`, and those of plant_commands.h. JSON lines answer each; `{"done": true}` is the last. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gantry.h"
#include "plant/plant_commands.h"
#include "port.h"
#include "telemetry.h"

#define MEMORY_WRITE 0.0034 /* s of a byte */

static struct plant plant;
static uint32_t clock_at_begin;

static void pass(double seconds)
{
    for (long i = 0; i < (long)(seconds / PLANT_DT + 0.5); i++)
        plant_step(&plant);
}

void port_exchange(uint8_t *bytes)
{
    chain_select(&plant.chain, true);
    for (int m = MOTORS; m-- > 0;)
        bytes[m] = chain_shift(&plant.chain, bytes[m]);
    chain_select(&plant.chain, false);
}

void port_hold_drivers(void)
{
    for (int m = 0; m < MOTORS; m++)
        l6470_wake(&plant.chain.chips[m], false);
}

void port_reset_drivers(void)
{
    port_hold_drivers();
    pass(0.001);
    for (int m = 0; m < MOTORS; m++)
        l6470_wake(&plant.chain.chips[m], true);
    pass(0.002);
}

uint32_t port_now(void)
{
    return (uint32_t)(plant.time * 1000 + 1e-6) + clock_at_begin;
}

static uint8_t memory[256];
static long writes_left = LONG_MAX; /* until the power fails, which lasts until `restart` */
static double memory_busy_until;

uint8_t port_memory_read(uint8_t address)
{
    return memory[address];
}

/* Of the byte that is written while the power fails, any bits may be lost. */
void port_memory_write(uint8_t address, uint8_t byte)
{
    memory_busy_until = plant.time + MEMORY_WRITE;
    if (writes_left > 0)
        memory[address] = byte;
    else if (writes_left == 0)
        memory[address] ^= (uint8_t)((memory[address] ^ byte) & 0x5A);
    writes_left -= writes_left >= 0;
}

bool port_memory_busy(void)
{
    return plant.time < memory_busy_until;
}

static bool remember(const char *line)
{
    unsigned at, bits;
    if (strcmp(line, "blank") == 0)
        memset(memory, 0xFF, sizeof memory);
    else if (sscanf(line, "cut %ld", &writes_left) == 1)
        return true;
    else if (sscanf(line, "flip %u %u", &at, &bits) == 2 && at < sizeof memory)
        memory[at] ^= (uint8_t)bits;
    else
        return false;
    return true;
}

void port_send_line(const char *line)
{
    telemetry_send("\"answer\": \"%s\"", line);
}

static void send(const char *hex)
{
    unsigned value;
    for (; sscanf(hex, "%2x", &value) == 1; hex += 2)
        gantry_receive((uint8_t)value);
}

static void run(double seconds)
{
    for (long i = 0; i < (long)(seconds / PLANT_DT + 0.5); i++) {
        plant_step(&plant);
        gantry_tick();
    }
}

static bool execute(char *line)
{
    line[strcspn(line, "\n")] = '\0';
    if (strncmp(line, "send ", 5) == 0)
        send(line + 5);
    else if (strncmp(line, "run ", 4) == 0)
        run(strtod(line + 4, NULL));
    else if (strncmp(line, "pass ", 5) == 0)
        pass(strtod(line + 5, NULL));
    else if (strncmp(line, "wraps ", 6) == 0)
        clock_at_begin -= port_now() + (uint32_t)(strtod(line + 6, NULL) * 1000);
    else if (strncmp(line, "memory ", 7) == 0)
        return remember(line + 7);
    else if (strcmp(line, "restart") == 0) {
        writes_left = LONG_MAX;
        gantry_start();
    }
    else
        return plant_command(&plant, line);
    return true;
}

int main(int argc, char **argv)
{
    static char line[1 << 20];
    double place[AXES] = {0.1, -0.1, 0.2};
    for (int a = 0; a < AXES && a + 1 < argc; a++)
        place[a] = strtod(argv[a + 1], NULL);
    plant_start(&plant, RIG_KIND, place);
    remember("blank");
    gantry_start();
    while (fgets(line, sizeof line, stdin) != NULL && strcmp(line, "quit\n") != 0)
        telemetry_send("\"done\": %s", execute(line) ? "true" : "false");
    return 0;
}
