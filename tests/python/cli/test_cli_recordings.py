"""Recording and replaying: what was seen live, exported, and compared with this host's core bit by
bit."""

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from board_cases import board_of, write_scene

import eitskin
from board_on_a_port import behind_a_port
from eitskin.cli.main import main
from eitskin.device.wire.codec import Decoder, Packet, encode
from eitskin.device.wire.link_table import PacketType
from eitskin.model.prebuilt import load_prebuilt
from fresh_python import INTERRUPTIBLE, MAIN, run_python, without, words

Change = Callable[[Packet], bytes | None]

FRAMES = 6
SOLVED_HEAD = 68
RAW_HEAD = 16

ALONE = "--mode raw,image"  # nothing of the frames before is in these
QUIETLY = ("--ignore", "crowded")  # a press that fades, solved coarsely, may be called so


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    return write_scene(tmp_path_factory.mktemp("scene") / "one.toml", FRAMES)


@pytest.fixture(scope="module")
def run(scene, tmp_path_factory) -> Path:
    """A recording of everything."""
    path = tmp_path_factory.mktemp("run") / "run.eits"
    assert main(words(f"record --device sim:{scene} -o {path}")) == 0
    return path


def packets(path: Path) -> list[Packet]:
    return Decoder().feed(path.read_bytes())


def changed(path: Path, target: Path, change: Change) -> Path:
    """The recording with the payload of each packet as ``change`` gives it, without those where it
    gives None."""
    kept = ((p, change(p)) for p in packets(path))
    target.write_bytes(
        b"".join(encode(p.type, p.sequence, payload) for p, payload in kept if payload is not None)
    )
    return target


def nth(kind: PacketType, number: int, change: Callable[[bytes], bytes | None]) -> Change:
    """Change the ``number``-th packet (from 0) of ``kind``."""
    counted = iter(range(10**6))

    def one(packet: Packet) -> bytes | None:
        if packet.type == kind and next(counted) == number:
            return change(packet.payload)
        return packet.payload

    return one


def flipped(place: int) -> Callable[[bytes], bytes]:
    """The lowest bit of a byte turned round."""
    return lambda payload: payload[:place] + bytes([payload[place] ^ 1]) + payload[place + 1 :]


def test_replay_shows_what_was_seen_live(done, scene, tmp_path):
    path = tmp_path / "run.eits"
    live = done(f"stream --device sim:{scene} --mode image,touches --record {path}")
    assert done(f"replay {path} --mode image,touches") == live
    lines = done(f"replay {path} --mode image,touches --first 2").splitlines()
    assert lines[:2] == live.splitlines()[:2] and lines[2].startswith("2 frames")


def test_a_scene_that_began_again_replays_to_the_end(done, scene, tmp_path):
    path, frames = tmp_path / "run.eits", 3 * FRAMES
    live = done(f"stream --device sim:{scene}?loop=1 --frames {frames} --record {path}")
    assert f"{frames} of {frames} touches found" in live
    seen, replayed = live.splitlines(), done(f"replay {path}").splitlines()
    assert replayed[:-2] + replayed[-1:] == seen[:-2] + seen[-1:]  # what the board counted is live


def test_gestures_of_a_recording_that_has_touches_alone(done, tmp_path):
    path, tap = tmp_path / "run.eits", ("--device", "sim:tap", "--ignore", "all")
    live = [line for line in done("stream", *tap).splitlines() if "tap" in line]
    done("record", *tap, f"--mode touches -o {path}")
    *shown, _ = done(f"replay {path} --mode events").splitlines()
    assert len(live) == 1 and shown[-1:] == live
    assert not any(line.split()[1].isdigit() for line in shown)


def test_a_recording_is_a_device_too(done, json_of, run):
    shown, replayed = (
        done(f"{command}{run}").splitlines()[0]
        for command in ("stream -v --device file:", "replay -v ")
    )
    assert shown == replayed and ", off by " in shown
    facts = json_of(f"info --device file:{run}")
    sha256 = hashlib.sha256(load_prebuilt()[1]).hexdigest()
    assert facts["statistics"] is None and facts["sha256"] == {"model": sha256, "firmware": None}
    assert sha256 in done(f"info --device file:{run}")
    assert json_of(f"doctor --device file:{run}")["measured"]["quiet_frames"] == 16


def test_record_says_how_much(json_of, scene, tmp_path):
    path = tmp_path / "run.eits"
    facts = json_of(f"record --device sim:{scene} -o {path} --frames 3")
    assert facts["frames"] == 3 and facts["bytes"] >= path.stat().st_size > 10_000
    assert facts["packets"] == sum(p.type not in (PacketType.RECORDING,) for p in packets(path)) - 1
    assert len([p for p in packets(path) if p.type == PacketType.RAW]) == 16 + 3
    again = json_of(f"record --device sim:{scene} -o {path} --seconds 0.1 --overwrite")
    assert again["frames"] == 3


# ---- the same bits ----


def test_the_hosts_images_are_the_boards(done, json_of, run):
    found = done(f"replay {run} --check")
    assert found == f"same bits: yes, {FRAMES} images and the touches of {FRAMES} frames\n"
    facts = json_of(f"replay {run} --check")
    assert facts["same_bits"] and facts["solver_noted"]
    assert (facts["same"], facts["inconclusive"]) == (FRAMES, 0)


@pytest.mark.parametrize(
    "options",
    ["--cold", "--iterations 9", "--sign both", "--tare 1", "--reciprocal 0"],
)
def test_whatever_the_solver_was_told(options, done, json_of, scene, tmp_path):
    path = tmp_path / "run.eits"
    done(f"record --device sim:{scene} -o {path}", *QUIETLY, options)
    # after a tare of one frame the scene begins within a scan, which is left out of the stream
    assert json_of(f"replay {path} --check")["same"] == FRAMES - (options == "--tare 1")


@pytest.mark.parametrize(
    ("kind", "number", "place", "different"),
    [
        (PacketType.IMAGE, 2, SOLVED_HEAD + 4 * 400, 1),
        (PacketType.TOUCHES, 2, SOLVED_HEAD + 4, 1),
        # what the host makes of a changed raw frame it begins the next one from
        (PacketType.RAW, 16 + 2, RAW_HEAD + 4 * 60 + 1, None),
        (PacketType.RAW, 3, RAW_HEAD + 4 * 60 + 2, FRAMES),
    ],
    ids=["image", "touches", "raw", "reference: every frame"],
)
def test_one_bit_that_differs_is_found(kind, number, place, different, run, tmp_path, ran):
    other = changed(run, tmp_path / "other.eits", nth(kind, number, flipped(place)))
    out, err = ran(10, f"replay {other} --check --json")
    facts = json.loads(out)
    assert not facts["same_bits"] and facts["different"][0] == (18 if number != 3 else 16)
    assert different in (None, len(facts["different"]))
    assert err == f"eitskin: {other}: this host's images differ from the board's\n"


def lost(run: Path, target: Path, number: int = 16 + 1) -> Path:
    """The recording without one of its raw frames."""
    return changed(run, target, nth(PacketType.RAW, number, lambda payload: None))


@pytest.mark.parametrize(
    ("how", "same"), [("--warm", 1), ("", 1), (ALONE, FRAMES - 1)],
    ids=["warm", "tracked", "each by itself"],
)  # fmt: skip
def test_frames_after_a_loss_are_not_called_different(how, same, done, json_of, scene, tmp_path):
    """A warm solve begins from the last one, and touches that are tracked through scans need the
    drives of the frame that is lost: the host's have other bits and nobody's fault it is. Without
    touches, every frame can be judged."""
    run = tmp_path / "run.eits"
    done(f"record --device sim:{scene} -o {run}", how)
    facts = json_of(f"replay {lost(run, tmp_path / 'other.eits')} --check")
    assert facts["different"] == [] and facts["alone"] == 1
    assert facts["same"] + facts["inconclusive"] == FRAMES - 1
    assert same in (None, facts["same"]) and (facts["inconclusive"] > 0) == (how != ALONE)


def test_an_image_after_a_loss_is_judged_all_the_same(done, scene, tmp_path, ran):
    """Without touches, each image is of its frame alone: one that differs is reported, whatever was
    lost before."""
    run = tmp_path / "run.eits"
    done(f"record --device sim:{scene} -o {run}", ALONE)
    image = nth(PacketType.IMAGE, 3, flipped(SOLVED_HEAD + 4 * 400))
    other = changed(lost(run, tmp_path / "lost.eits"), tmp_path / "other.eits", image)
    assert len(json.loads(ran(10, f"replay {other} --check --json")[0])["different"]) == 1


def test_a_loss_in_the_tare_leaves_nothing_to_compare(run, tmp_path, ran):
    other = lost(run, tmp_path / "other.eits", 5)
    assert "nothing to compare" in ran(8, f"replay {other} --check")[1]


def test_without_its_note_the_models_own_options_are_taken(
    done, json_of, scene, run, tmp_path, ran
):
    def unnoted(run: Path, name: str) -> Path:
        return changed(run, tmp_path / name, nth(PacketType.RECORDING, 1, lambda payload: None))

    facts = json_of(f"replay {unnoted(run, 'plain.eits')} --check")
    assert facts["same"] == FRAMES and not facts["solver_noted"]
    odd = tmp_path / "odd.eits"
    done(f"record --device sim:{scene} -o {odd}", *QUIETLY, "--iterations 5")
    said = ran(10, f"replay {unnoted(odd, 'plain2.eits')} --check")[1]
    assert "the recording does not hold the solver's options" in said


# ---- export ----


def test_rows_that_could_not_be_measured_are_not_exported(done, json_of, run, tmp_path):
    def with_nan(payload: bytes) -> bytes:
        return payload[:RAW_HEAD] + np.float32(np.nan).tobytes() + payload[RAW_HEAD + 4 :]

    other = changed(run, tmp_path / "other.eits", nth(PacketType.RAW, 16 + 3, with_nan))
    exported = tmp_path / "run.npz"
    facts = json_of(f"replay {other} --frames {exported}")
    assert (facts["frames"], facts["quiet_frames"], facts["left_out"]) == (FRAMES - 1, 16, 1)
    assert done(f"reconstruct {exported}").count("\n") == FRAMES - 1 + 2
    raw = done(f"replay {other} --mode raw").splitlines()[3]
    assert "1 not usable" in raw


# ---- what a base installation can do ----


def test_a_recording_needs_no_extra(run):
    bare = without("scipy", "netgen", "matplotlib", "unicorn") + MAIN
    for arguments, expected in (
        (["replay", run], f"{FRAMES} frames"),
        (["replay", run, "--check"], "same bits: yes"),
        (["stream", "--device", f"file:{run}", "--mode", "raw,image,touches"], f"{FRAMES} frames"),
        (["info", "--device", f"file:{run}"], "board       simulated"),
        (["doctor", "--device", f"file:{run}"], "0 faults"),
    ):
        done = run_python(bare, *arguments)
        assert (done.returncode, done.stderr) == (0, "") and expected in done.stdout, arguments


# ---- Ctrl-C ----


def test_ctrl_c_stops_the_board_and_sums_up(scene):
    board = board_of(scene)
    environment = {**os.environ, "PYTHONPATH": str(Path(eitskin.__file__).parents[1])}
    with behind_a_port(board) as port:
        command = words(f"stream --device serial:{port} -v --tare 4")
        with subprocess.Popen(
            [sys.executable, "-c", INTERRUPTIBLE, *command],
            env=environment | {"OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            assert process.stdout is not None
            for _ in range(5):
                assert "no touch" in process.stdout.readline()
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30)
        assert process.returncode == 0 and err.endswith("eitskin: stopped\n")
        assert " frames, " in out.splitlines()[-1] and "0 gaps" in out.splitlines()[-1]
        assert not board.wanted
