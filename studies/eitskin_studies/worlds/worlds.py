"""The sets of other worlds: their touches, and the errors of their skins."""

from dataclasses import dataclass, field

Range = tuple[float, float]


@dataclass(frozen=True)
class TouchKinds:
    """How a scene's touches are drawn, each range uniformly.

    Attributes:
        count: the least and the most touches.
        radius_mm: of the disc of the same area.
        contrast: conductivity in the middle over the sheet's.
        aspect: long over short axis.
        shape: of ``eitskin.scene.touch_shape.SHAPES``; None: even discs.
        gap_mm: least distance between the edges of two touches.
        spacing_radii: least distance between two middles over the mean of their radii, instead.
        pair_mm: two touches side by side, their middles so far apart, instead.
    """

    count: tuple[int, int] = (1, 3)
    radius_mm: Range = (6.0, 12.0)
    contrast: Range = (3.0, 10.0)
    aspect: Range = (1.0, 1.0)
    shape: str | None = None
    gap_mm: float = 12.0
    spacing_radii: float | None = None
    pair_mm: Range | None = None


@dataclass(frozen=True)
class Errors:
    """The skin's errors that the model does not know, as standard deviations; each scene draws its
    own.

    Attributes:
        contact_spread: each contact's impedance is the skin's times 1 + uniform(-s, s).
        contact_log_sd: or times exp(this times a normal number), instead.
        misplaced_mm: electrodes along the rim.
        out_of_round: radius by angle, over the mean radius, in the second and third harmonic.
        uneven: log conductivity of the sheet, a smooth field.
        drift: log conductivity, another such field, after the tare.
        contact_drift, amplitude_drift: relative changes after the tare.
        correlation: range of the fields' correlation length over the skin's radius.
    """

    contact_spread: float = 0.2
    contact_log_sd: float = 0.0
    misplaced_mm: float = 0.0
    out_of_round: float = 0.0
    uneven: float = 0.0
    drift: float = 0.0
    contact_drift: float = 0.0
    amplitude_drift: float = 0.0
    correlation: Range = (0.35, 1.0)


@dataclass(frozen=True)
class World:
    """A set: touches, errors, noise (None: none). ``adc_bits`` 0: no converter; None: 12, or 16
    from 70 dB on, as elsewhere. ``sign``: which changes the core is told to look for; None: as it
    is."""

    text: str
    touches: TouchKinds = field(default_factory=TouchKinds)
    errors: Errors = field(default_factory=Errors)
    snr_db: float | None = 60.0
    adc_bits: int | None = None
    sign: str | None = None


NONE = TouchKinds(count=(0, 0))
FINGERS = TouchKinds(aspect=(1.4, 2.2), shape="finger")
MILD = Errors(
    contact_log_sd=0.3,
    misplaced_mm=0.5,
    uneven=0.05,
    drift=0.003,
    contact_drift=0.03,
    amplitude_drift=0.003,
)
EIGHT = TouchKinds((8, 8), (9.0, 9.0), (5.0, 5.0), spacing_radii=4.0)
EIGHT_UNLIKE = TouchKinds((8, 8), (6.5, 11.0), spacing_radii=4.0)
FIVE = TouchKinds((5, 5), (9.0, 9.0), (5.0, 5.0), spacing_radii=2.5)
FIVE_UNLIKE = TouchKinds((5, 5), (6.5, 11.0), spacing_radii=2.5)


def _two_fingers(low_mm: float, high_mm: float) -> TouchKinds:
    return TouchKinds(
        (2, 2), (5.0, 8.0), aspect=(1.4, 2.2), shape="finger", pair_mm=(low_mm, high_mm)
    )


WORLDS: dict[str, World] = {
    "discs_1_to_3": World("1 to 3 discs, radius 6 to 12 mm, contrast 3 to 10: the model's world"),
    "light_touches": World(
        "1 to 3 discs of contrast 1.15 to 1.8", TouchKinds(contrast=(1.15, 1.8))
    ),
    "eight_at_4_radii": World(
        "8 discs of radius 9 mm, contrast 5, at least 36 mm apart", EIGHT, snr_db=80.0
    ),
    "eight_unlike_at_4_radii": World(
        "8 discs, radius 6.5 to 11 mm, contrast 3 to 10, at least 4 mean radii apart",
        EIGHT_UNLIKE,
        snr_db=80.0,
    ),
    "five_at_2_5_radii": World("5 discs of radius 9 mm, contrast 5, at least 22.5 mm apart", FIVE),
    "five_unlike_at_2_5_radii": World(
        "5 discs, radius 6.5 to 11 mm, contrast 3 to 10, at least 2.5 mean radii apart",
        FIVE_UNLIKE,
    ),
    "uneven_20_percent": World("1 to 3 discs; the skin is uneven", errors=Errors(uneven=0.2)),
    "drift_2_percent_strong": World(
        "1 to 3 discs; the skin has changed by a smooth 2 % since the tare",
        errors=Errors(drift=0.02),
    ),
    "drift_2_percent_light": World(
        "1 to 3 discs of contrast 1.3 to 2; the same drift",
        TouchKinds(contrast=(1.3, 2.0)),
        Errors(drift=0.02),
    ),
    "misplaced_1_mm": World(
        "1 to 3 discs; electrodes misplaced by 1 mm", errors=Errors(misplaced_mm=1.0)
    ),
    "misplaced_3_mm": World(
        "1 to 3 discs; electrodes misplaced by 3 mm", errors=Errors(misplaced_mm=3.0)
    ),
    "out_of_round_2_percent": World(
        "1 to 3 discs; the outline is out of round", errors=Errors(out_of_round=0.02)
    ),
    "ellipses": World(
        "1 to 3 flat ellipses, axes 1.4 to 2.2", TouchKinds(aspect=(1.4, 2.2), shape="ellipse")
    ),
    "hertz_discs": World("1 to 3 discs with Hertz profile", TouchKinds(shape="hertz")),
    "gaussian_blobs": World(
        "1 to 3 Gaussian blobs, half height at 4 to 8 mm",
        TouchKinds(radius_mm=(4.0, 8.0), shape="gauss"),
    ),
    "insulating_touches": World(
        "1 to 3 discs of contrast .1 to .5, both signs looked for",
        TouchKinds(contrast=(0.1, 0.5)),
        sign="both",
    ),
    "fingers": World("1 to 3 fingers: ellipses with Hertz profile, axes 1.4 to 2.2", FINGERS),
    "fingers_mild_errors": World("1 to 3 fingers with mild errors of all kinds", FINGERS, MILD),
    "eight_mild_errors": World(
        "8 discs at 4 radii with mild errors of all kinds", EIGHT, MILD, snr_db=80.0
    ),
    "two_fingers_16_to_24_mm": World(
        "two fingers side by side, radius 5 to 8 mm", _two_fingers(16.0, 24.0)
    ),
    "two_fingers_12_to_16_mm": World("two fingers side by side, nearer", _two_fingers(12.0, 16.0)),
    "no_touch": World("no touch, noise and contacts", NONE),
    "no_touch_drift_2_percent": World("no touch, a smooth drift of 2 %", NONE, Errors(drift=0.02)),
    "no_touch_uneven_20_percent": World("no touch, an uneven sheet", NONE, Errors(uneven=0.2)),
    "no_touch_misplaced_3_mm": World(
        "no touch, misplaced electrodes", NONE, Errors(misplaced_mm=3.0)
    ),
    "no_touch_contact_drift_10_percent": World(
        "no touch, contacts changed since the tare", NONE, Errors(contact_drift=0.1)
    ),
    "no_touch_amplitude_drift_1_percent": World(
        "no touch, the current changed since the tare", NONE, Errors(amplitude_drift=0.01)
    ),
    "no_touch_converter_without_dither": World(
        "no touch, 12 bits without noise, and .01 % of drift", NONE, Errors(drift=1e-4), None, 12
    ),
    "no_touch_noiseless": World(
        "no touch, neither noise nor converter, and a millionth of drift",
        NONE,
        Errors(drift=1e-6),
        None,
        0,
    ),
}


def in_words(name: str) -> str:
    """Return the name of a world as a picture shows it."""
    return name.replace("2_5_radii", "2.5_radii").replace("_percent", " %").replace("_", " ")
