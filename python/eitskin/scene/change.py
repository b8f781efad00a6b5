"""When a change after the tare happens: at once, or slowly."""


def part_at(time_s: float, at_s: float, rise_s: float) -> float:
    """The part of a change that has happened at ``time_s``: 0 before ``at_s``, then in proportion
    to time until it is whole ``rise_s`` later (0: at once)."""
    if time_s < at_s:
        return 0.0
    return 1.0 if rise_s <= 0 else min(1.0, (time_s - at_s) / rise_s)
