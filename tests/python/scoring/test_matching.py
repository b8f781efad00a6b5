"""Optimal matching with a gate: crossed pairs, lexicographic optimum, counts."""

from itertools import permutations

import numpy as np
import pytest

from eitskin.scoring.matching import match


@pytest.mark.parametrize(
    ("true", "found", "pairs", "distances"),
    [
        # nearest first would pair true 1 with found 0 (1 mm) and leave 9 mm; the best sum is 3 + 5
        ([[0, 0], [4, 0]], [[3, 0], [9, 0]], ((0, 0), (1, 1)), (3.0, 5.0)),
        ([[0, 0], [50, 0]], [[49, 0], [0, 2]], ((0, 1), (1, 0)), (2.0, 1.0)),
        # one pair at 0 mm and a miss, or two pairs at 9 and 9 mm: two hits win
        ([[0, 0], [9, 0]], [[9, 0], [18, 0]], ((0, 0), (1, 1)), (9.0, 9.0)),
        # (0.01 mm) beyond the gate are a miss and a false touch
        ([[0, 0], [50, 0]], [[10.01, 0], [50, 10], [90, 0]], ((1, 1),), (10.0,)),
        ([], [], (), ()),
        ([[1, 1]], [], (), ()),
        ([], [[1, 1]], (), ()),
    ],
    ids=["the best sum", "any order", "hits before distances", "the gate", "nothing", "a miss",
         "a false touch"],
)  # fmt: skip
def test_pairs(true, found, pairs, distances):
    matching = match(true, found)
    assert (matching.pairs, matching.distances_mm) == (pairs, distances)
    counts = matching.hits, matching.misses, matching.false_touches
    assert counts == (len(pairs), len(true) - len(pairs), len(found) - len(pairs))
    assert matching.exact == (len(pairs) == len(true) == len(found))


def test_equals_brute_force_over_all_assignments():
    generator = np.random.default_rng(3)
    for _ in range(60):
        true, found = generator.uniform(0, 25, (4, 2)), generator.uniform(0, 25, (4, 2))
        distance = np.hypot(*(true[:, None] - found[None]).transpose(2, 0, 1))
        best = (0, 0.0)
        for order in permutations(range(4)):
            near = [distance[i, j] for i, j in enumerate(order) if distance[i, j] <= 10.0]
            best = min(best, (-len(near), sum(near)))
        matching = match(true, found)
        assert (-matching.hits, sum(matching.distances_mm)) == pytest.approx(best)
