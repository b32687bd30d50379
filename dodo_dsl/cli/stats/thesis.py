"""Table 5.1 of the thesis that architecture.md cites: its nine tests in its order, with their services, and its fit."""

_LOOP = ("virtual-camera", "dynamic-model", "integrator", "collision")
_OPEN = ("virtual-camera", "beacon", "continuous-signal")

TESTS: dict[str, tuple[str, ...]] = {
    "sil-open-straight": _OPEN,
    "sil-closed-straight": _LOOP,
    "sil-open-left-curve": _OPEN,
    "sil-closed-left-curve": _LOOP,
    "sil-closed-kiwi-track": _LOOP,
    "dil-static-rig": ("rec-replay", "continuous-signal"),
    "dil-kiwi-track": ("rec-replay", "continuous-signal"),
    "hil-camera": ("camera", "object-detection"),
    "hil-dynamic": ("camera", "dynamic-model", "integrator", "gantry", "collision"),
}

LN_A = 0.66
"""Stated as a: but then one test would need 0.66 services; it is the intercept of the line in log space."""
B, B_INTERVAL = 0.78, (0.63, 0.92)
