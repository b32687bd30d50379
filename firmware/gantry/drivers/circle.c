#include "drivers/circle.h"

struct circle circle;

int32_t circle_heading(int32_t position)
{
    int32_t rest = position % TURN;
    return rest < 0 ? rest + TURN : rest;
}

int32_t circle_distance(int32_t from, int32_t to, enum way way)
{
    int32_t left = circle_heading(to - from);
    bool right = way == WAY_RIGHT || (way == WAY_SHORTEST && left > TURN / 2);
    return right && left != 0 ? left - TURN : left;
}

int32_t circle_follow(int32_t before, int32_t counter)
{
    uint32_t change = ((uint32_t)counter - (uint32_t)before) & 0x3FFFFFUL;
    return before + (int32_t)(change < 0x200000UL ? change : change - 0x400000UL);
}
