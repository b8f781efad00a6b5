"""Which effects there are, and how a table of a scene becomes an effect's parameters.

Built-in effects are listed by name and module; a user's package adds its own by an entry point of the group
``eitskin.effects`` (name = module). A module is imported when a scene names its effect, and not before.
"""

from __future__ import annotations

BUILT_IN: dict[str, str] = {
    name: f"eitskin.scene.effects.{name}"
    for name in (
        "misplacement",
        "gel_drying",
        "temperature",
        "background",
        "contact_impedance",
        "detached",
        "bridged",
        "phase",
        "source_impedance",
        "amplitude_drift",
        "channel_gain",
        "mux",
        "charge_injection",
        "crosstalk",
        "mains",
        "common_mode",
        "noise",
        "saturation",
        "adc",
        "jitter",
    )
}
