"""The doctor names the pattern of rows that were stated to be another's."""

from dataclasses import replace

import pytest
from injected import healthy_frames

from eitskin.frames.doctor.examine import examine
from eitskin.frames.doctor.subject import subject_from_frames
from eitskin.skin.protocol import pattern, pattern_name
from eitskin.skin.skin import paper_skin

SAME_ROWS = ("adjacent", "skip-1", "skip-2", "skip-3", "skip-4", "skip-5", "skip-6")


def findings(true: str, said: str, measure: str | None = None, seed: int = 5) -> list[str]:
    scanned = pattern(16, true, measure)
    frames = replace(healthy_frames(seed, scanned), protocol=pattern(16, said))
    report = examine(subject_from_frames(frames, paper_skin()))
    for finding in report.findings:
        if finding.name == "pattern":
            assert f"those of {pattern_name(scanned)}, not of {said}" in finding.text
    return [f"{finding.name}: {finding.repair}" for finding in report.findings]


@pytest.mark.parametrize("true", SAME_ROWS)
@pytest.mark.parametrize("said", ["adjacent", "skip-3"])
def test_another_pattern_with_as_many_rows_is_named(true, said):
    expected = [] if true == said else [f"pattern: --protocol {true}"]
    assert findings(true, said) == expected


def test_opposite_and_mixed_patterns_are_named():
    assert findings("skip-3", "opposite", "adjacent") == [
        "pattern: --protocol skip-3 --measure adjacent"
    ]
    assert findings("opposite", "opposite") == []


def test_a_rotating_order_is_named_with_the_pattern():
    from test_doctor import rotating

    made = rotating(healthy_frames(6, pattern(16, "skip-3")))
    frames = replace(made, protocol=pattern(16, "adjacent"))
    (finding,) = examine(subject_from_frames(frames, paper_skin())).findings
    assert finding.repair == "--protocol skip-3 --order rotating"
