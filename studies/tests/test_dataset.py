"""Datasets: the same bytes however made, resumed where left, ranges kept."""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eitskin.errors import ConfigError, FileError, MissingExtraError, UsageError
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.library_scenes import find_scene
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.touch_path import always
from eitskin_studies.cli import cmd_dataset
from eitskin_studies.datasets import dataset
from eitskin_studies.datasets.dataset import (
    Job,
    chunk_path,
    frames_of,
    job_of,
    load_chunk,
    make_chunk,
    write_dataset,
)
from eitskin_studies.datasets.ranges import drawn, ranges_of

ELEMENTS = 600  # a coarse mesh


def still_scene(**changes: Any) -> Scene:
    """A touch that stays."""
    given = {
        "touches": (always(-30, 20, 10),), "frames": 3, "quiet_frames": 2, "elements": ELEMENTS,
    }  # fmt: skip
    return Scene("still", **{**given, **changes})


def dataset_command(*arguments: str) -> int:
    parser = argparse.ArgumentParser()
    cmd_dataset.add_parser(parser.add_subparsers())
    options = parser.parse_args(["dataset", *arguments])
    return int(options.run(options))


def small_job(count: int = 7, seed: int = 3, chunk: int = 3) -> Job:
    scene = replace(find_scene("random_touches"), elements=ELEMENTS)
    return job_of(scene, count, seed, chunk=chunk)


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_same_bytes_whatever_the_jobs(tmp_path):
    job = small_job()
    one = write_dataset(job, tmp_path / "one")
    write_dataset(job, tmp_path / "two", jobs=2)
    assert one == {"chunks_made": 3, "chunks_kept": 0, "scenes_made": 7}
    assert content(tmp_path / "one") == content(tmp_path / "two")
    assert len(content(tmp_path / "one")) == 4


def test_an_interrupted_run_resumes_without_doing_things_twice(tmp_path, monkeypatch):
    job, made = small_job(), []
    real = make_chunk

    def interrupted(job: Job, chunk: int, mesh_cache: MeshCache | None = None) -> bytes:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(chunk)
        return real(job, chunk, mesh_cache)

    monkeypatch.setattr(dataset, "make_chunk", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_dataset(job, tmp_path / "d")
    assert made == [0, 1] and not chunk_path(tmp_path / "d", 2).exists()
    before = {k: chunk_path(tmp_path / "d", k).stat().st_mtime_ns for k in (0, 1)}
    made.clear()
    found = write_dataset(job, tmp_path / "d")
    assert found == {"chunks_made": 1, "chunks_kept": 2, "scenes_made": 1}
    assert made == [2]
    assert before == {k: chunk_path(tmp_path / "d", k).stat().st_mtime_ns for k in (0, 1)}
    monkeypatch.undo()
    write_dataset(job, tmp_path / "whole")
    assert content(tmp_path / "d") == content(tmp_path / "whole")


def test_a_folder_with_another_dataset_is_not_mixed(tmp_path):
    write_dataset(small_job(3), tmp_path / "d")
    others = {
        "count": small_job(4),
        "seed": small_job(3, seed=4),
        "scenes_a_chunk": small_job(3, chunk=2),
    }
    for said, other in others.items():
        with pytest.raises(UsageError, match=rf"holds another dataset \({said} differ"):
            write_dataset(other, tmp_path / "d")
    (tmp_path / "d" / "dataset.json").write_text("x", encoding="utf-8")
    with pytest.raises(UsageError, match="another dataset"):
        write_dataset(small_job(3), tmp_path / "d")


def test_a_scene_of_a_dataset_is_the_scene_run_alone(tmp_path):
    job = small_job()
    write_dataset(job, tmp_path / "d")
    chunk = load_chunk(chunk_path(tmp_path / "d", 1))
    assert chunk["voltage_v"].shape == (3, 1, 208) and chunk["first_scene"] == 3
    alone = drawn(job.scene, job.ranges, job.seed, 4)
    frames = frames_of(chunk, 1)
    assert np.array_equal(frames.voltage_v, simulate_frames(compile_scene(alone)).voltage_v[1:])
    places = [[t.keyframes[0].x_mm, t.keyframes[0].y_mm] for t in alone.touches]
    strengths = [t.law.contrast_at(np.ones(1))[0] - 1 for t in alone.touches]
    assert frames.touch_xy_mm.tolist() == places
    assert frames.touch_strength == pytest.approx(strengths)
    assert chunk["range_name"].tolist() == ["effects.noise.snr_db"]
    assert chunk["range_value"][1, 0] == alone.effects["noise"]["snr_db"]
    with pytest.raises(UsageError, match="counted from 0"):
        frames_of(chunk, 3)


def test_ranges_are_kept_and_independent_of_each_other():
    scene = still_scene(effects={"adc": {"bits": 12}, "mains": {}})
    touch = {"0": {"radius_mm": [6.0, 9.0], "x_mm": [-40, 40]}}
    table = {"ranges": {"effects": {"adc": {"bits": [8, 14]}}, "touch": touch}}
    ranges = ranges_of(table, scene, "f")
    found = [drawn(scene, ranges, 5, k) for k in range(60)]
    bits = {one.effects["adc"]["bits"] for one in found}
    radii = [one.touches[0].keyframes[0].radius_mm for one in found]
    assert bits == set(range(8, 15)) and all(isinstance(value, int) for value in bits)
    assert 6 <= min(radii) < 6.5 and 8.5 < max(radii) <= 9
    assert len({one.seed for one in found}) == 60 and found[7] == drawn(scene, ranges, 5, 7)
    fewer = ranges_of({"ranges": {"touch": {"0": {"radius_mm": [6.0, 9.0]}}}}, scene, "f")
    assert drawn(scene, fewer, 5, 9).touches[0].keyframes[0].radius_mm == radii[9]


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"range": {}}, r"f \[dataset\]: unknown key 'range'; did you mean 'ranges'"),
        ({"touches": {}}, r"f \[dataset.touches\]: the scene has touches of its own"),
        (
            {"ranges": {"effects": {"noise": {"snr_db": [1, 2]}}}},
            r"effects.noise.snr_db: the scene does not name",
        ),
        (
            {"ranges": {"effects": {"mains": {"amplitude_v": [2, 1]}}}},
            r"must be a range \[low, high\]",
        ),
        ({"ranges": {"effects": {"mains": {"amplitude_v": 3}}}}, r"must be a range \[low, high\]"),
        ({"ranges": {"touch": {"1": {"x_mm": [0, 1]}}}}, "the scene has 1 touches"),
        (
            {"ranges": {"touch": {"0": {"colour": [0, 1]}}}},
            "cannot be varied; use effects.NAME.KEY",
        ),
        ({"ranges": {"scene": {"frames": [0, 1]}}}, "cannot be varied"),
    ],
)
def test_bad_ranges_name_file_table_and_key(table, said):
    with pytest.raises(ConfigError, match=said):
        ranges_of(table, still_scene(effects={"mains": {}}), "f")


def test_bad_datasets_are_refused(tmp_path):
    scene = replace(find_scene("random_touches"), elements=ELEMENTS)
    (tmp_path / "c.npz").write_bytes(b"no")
    (tmp_path / "r.toml").write_text("[other]\n", encoding="utf-8")
    unknown = {"ranges": {"effects": {"mains": {"amplitude": [0, 1]}}}}
    bad = still_scene(effects={"mains": {}}, dataset=unknown)
    outside = still_scene(dataset={"ranges": {"touch": {"0": {"x_mm": [200, 300]}}}})
    for make, error, said in (
        (lambda: job_of(scene, 0, 1), UsageError, "--count 0"),
        (lambda: job_of(scene, 1, -1), UsageError, "--seed -1"),
        (lambda: job_of(scene, 1, 1, chunk=0), UsageError, "--chunk 0"),
        (lambda: job_of(still_scene(), 2, 1), ConfigError, "nothing is drawn"),
        (lambda: job_of(bad, 2, 1), ConfigError,
         "unknown key 'amplitude'; did you mean 'amplitude_v'"),
        (lambda: job_of(outside, 2, 1), ConfigError,
         r"dataset scene 0 \(from 0\): .* outside the skin"),
        (lambda: job_of(scene, 1, 1, ranges_file=tmp_path / "r.toml"), ConfigError,
         r"r.toml: a ranges file holds the table \[dataset\]"),
        (lambda: write_dataset(small_job(), tmp_path / "d", jobs=0), UsageError, "--jobs 0"),
        (lambda: load_chunk(tmp_path / "c.npz"), FileError, None),
    ):  # fmt: skip
        with pytest.raises(error, match=said):
            make()


def test_without_dask_a_scheduler_asks_for_the_extra(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    with pytest.raises(MissingExtraError, match=r"pip install './studies\[cluster\]'"):
        write_dataset(small_job(), tmp_path / "d", scheduler="tcp://127.0.0.1:1")


def test_a_dask_cluster_gives_the_same_bytes(tmp_path):
    from dask import distributed

    job = small_job()
    write_dataset(job, tmp_path / "here")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        write_dataset(job, tmp_path / "there", scheduler=cluster.scheduler_address)
    assert content(tmp_path / "here") == content(tmp_path / "there")
    with pytest.raises(UsageError, match="no Dask scheduler answers there"):
        write_dataset(job, tmp_path / "nowhere", scheduler="nonsense")


def test_the_command_takes_ranges_from_a_file_and_resumes(tmp_path, capsys):
    scene = tmp_path / "s.toml"
    touch = "[[touch]]\nradius_mm = 9\nx_mm = 10\ny_mm = 20\n"
    head = f'[scene]\nname = "s"\nquiet_frames = 1\nelements = {ELEMENTS}\n'
    scene.write_text(head + touch, encoding="utf-8")
    ranges = tmp_path / "r.toml"
    ranges.write_text("[dataset.ranges.touch.0]\nx_mm = [-40.0, 40.0]\n", encoding="utf-8")
    command = [str(scene), "--ranges", str(ranges), "--count", "5", "--chunk", "2"]
    command += ["-o", str(tmp_path / "d")]
    assert dataset_command(*command, "--json") == 0
    assert json.loads(capsys.readouterr().out)["scenes_made"] == 5
    chunk_path(tmp_path / "d", 1).unlink()
    assert dataset_command(*command, "--jobs", "2") == 0
    assert "2 scenes in 1 chunks, 2 chunks were there already" in capsys.readouterr().out
    chunks = (load_chunk(chunk_path(tmp_path / "d", k)) for k in range(3))
    x = np.concatenate([chunk["touch_xy_mm"][:, 0] for chunk in chunks])
    assert len(set(x.tolist())) == 5 and np.abs(x).max() <= 40
    with pytest.raises(UsageError, match="give one of them"):
        dataset_command(*command, "--jobs", "2", "--scheduler", "tcp://h:1")
