#include "program/state.h"

struct emulator emulator = {.rate = 100, .place = {0.1, -0.1, 0.2}, .running = true};
