/* The controller's EEPROM, kept in a file between starts. */
#include <errno.h>
#include <simavr/avr_eeprom.h>
#include <stdio.h>

#include "board/board_internal.h"

#define SIZE 1024

static avr_eeprom_desc_t whole(uint8_t *bytes)
{
    return (avr_eeprom_desc_t){.ee = bytes, .offset = 0, .size = SIZE};
}

bool board_load_memory(const char *path)
{
    uint8_t bytes[SIZE];
    avr_eeprom_desc_t all = whole(bytes);
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        return errno == ENOENT;
    bool complete = fread(bytes, sizeof bytes, 1, file) == 1;
    fclose(file);
    if (complete)
        avr_ioctl(board.avr, AVR_IOCTL_EEPROM_SET, &all);
    return complete;
}

bool board_save_memory(const char *path)
{
    avr_eeprom_desc_t all = whole(NULL);
    avr_ioctl(board.avr, AVR_IOCTL_EEPROM_GET, &all);
    FILE *file = fopen(path, "wb");
    if (file == NULL)
        return false;
    bool written = fwrite(all.ee, SIZE, 1, file) == 1;
    return fclose(file) == 0 && written;
}
