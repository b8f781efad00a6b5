"""Optimal matching with a gate: crossed pairs, lexicographic optimum, counts."""

from itertools import permutations

import numpy as np
import pytest

from eitskin.scoring.matching import match


def test_crossed_pairs_are_matched_by_the_sum_not_greedily():
    """Nearest-first would pair true 1 with found 0 (1 mm) and leave 9 mm; the best sum is 3 + 5."""
    matching = match([[0, 0], [4, 0]], [[3, 0], [9, 0]])
    assert matching.pairs == ((0, 0), (1, 1))
    assert matching.distances_mm == (3.0, 5.0)
    assert matching.exact


def test_order_of_found_touches_does_not_matter():
    matching = match([[0, 0], [50, 0]], [[49, 0], [0, 2]])
    assert matching.pairs == ((0, 1), (1, 0))
    assert matching.distances_mm == (2.0, 1.0)


def test_more_hits_come_before_shorter_distances():
    """One pair at 0 mm and a miss, or two pairs at 9 and 9 mm: two hits win."""
    matching = match([[0, 0], [9, 0]], [[9, 0], [18, 0]])
    assert matching.hits == 2
    assert matching.distances_mm == (9.0, 9.0)


def test_beyond_the_gate_is_a_miss_and_a_false_touch():
    matching = match([[0, 0], [50, 0]], [[10.01, 0], [50, 10], [90, 0]])
    assert (matching.hits, matching.misses, matching.false_touches) == (1, 1, 2)
    assert matching.pairs == ((1, 1),)
    assert matching.distances_mm == (10.0,)
    assert not matching.exact


@pytest.mark.parametrize(
    ("true", "found", "misses", "false"),
    [([], [], 0, 0), ([[1, 1]], [], 1, 0), ([], [[1, 1]], 0, 1)],
)
def test_nothing_on_a_side(true, found, misses, false):
    matching = match(true, found)
    assert (matching.hits, matching.misses, matching.false_touches) == (0, misses, false)
    assert matching.exact == (misses == false == 0)


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
