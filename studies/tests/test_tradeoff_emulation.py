"""Instructions of a configuration, counted: what is not in a model's defaults reaches the emulated
core too."""

from dataclasses import replace

from eitskin.progress import silent
from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin.tuning.configuration import Configuration
from eitskin_studies.tradeoff.accuracy import solve_session
from eitskin_studies.tradeoff.emulation import Emulator, chosen_scenes, count_instructions
from eitskin_studies.tradeoff.engines import ModelShop
from eitskin_studies.tradeoff.scene_sets import SceneFactory


def test_counts_are_exact_and_follow_every_setting(cortex_m7):
    emulator = Emulator(cortex_m7 / "tests" / "emulated" / "frames_m7.elf")
    session = SceneFactory(paper_skin(), adjacent(16), 5, 1200).session("random", 6, silent)
    shop = ModelShop(paper_skin(), adjacent(16))
    base = Configuration("base", rank=32, pixels=16, iterations=20)
    counted = {}
    for one in (
        base,
        replace(base, name="again"),
        replace(base, name="sweeps", touch_sweeps=1),
        replace(base, name="gap", gap=0.05),
        replace(base, name="warm", warm_start=True),
    ):
        built = shop.build(one)
        solved = solve_session(one, built, session, 60.0)
        measured = session.measured(60.0, one.samples, one.scan, one.held)
        counted[one.name] = count_instructions(emulator, one, built, measured, solved, 3, 2)
    assert counted["base"] == counted["again"]
    parts = counted["base"]["solve_mean"] + counted["base"]["touch_mean"]
    assert (
        abs(counted["base"]["mean"] - parts) <= 1 and parts <= counted["base"]["most"]
    )  # each mean is rounded by itself
    # what one sweep spares, the joint fit after it may take
    assert counted["sweeps"]["touch_mean"] != counted["base"]["touch_mean"]
    assert counted["sweeps"]["solve_mean"] == counted["base"]["solve_mean"]
    assert counted["gap"]["solve_mean"] != counted["base"]["solve_mean"]
    assert counted["warm"]["kind"] == "counted"
    even, costly = chosen_scenes(solved, 3, 2)
    assert len(even) == 3 and len(costly) == 2 and even[0] == 0 and even[-1] == 5
