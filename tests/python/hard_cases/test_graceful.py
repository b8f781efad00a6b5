"""The image gets worse no faster than the frames do."""

from losses import BITS, LEVELS, NOISE, ROWS_OUT, all_steps, errors_of

CASE = "problem/graceful-loss"
DAMAGE = {"noise": NOISE, "rows left out": ROWS_OUT, "bits": tuple(2.0**-bits for bits in BITS)}


def test_graceful_loss(same_everywhere, margins):
    """The optimum follows the data as a projection does, no further than they move; so the error
    may grow in proportion to noise, rows lost and steps of the converter. Twice that is allowed,
    for the chance in where noise and losses fall, reckoned from the least damage that shows; and at
    the worst level three quarters of the image must be left."""
    (statuses, outcomes), within = same_everywhere.steps(all_steps()), margins.of(CASE)
    assert set(statuses) == {0} and all(one.status == 0 and one.finite() for one in outcomes)
    for kind, errors in errors_of(outcomes).items():
        assert len(errors) == len(LEVELS[kind])
        first = next(k for k, error in enumerate(errors) if error > 1e-4)
        for damage, error in zip(DAMAGE[kind][first + 1 :], errors[first + 1 :], strict=True):
            room = 2 * errors[first] * damage / DAMAGE[kind][first]
            what = f"change of the image in proportion to {kind}"
            within(what, error, room, "of the image")
        within(f"change of the image, most {kind}", errors[-1], 0.25, "of the image")
