"""Many seeded scenes into a folder of chunks: over the cores, or over a Dask cluster; interrupted
runs resume.

Each chunk is an .npz that is written beside and then renamed, so that what is there is whole. A
chunk depends on the description, the seed and its number only, and so is the same, byte for byte,
however many jobs make it and in which order. ``dataset.json`` says what the folder holds; a run
with other settings refuses to continue it.
"""

import hashlib
import io
import json
import os
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from eitskin.arrays import AnyArray
from eitskin.config import load_toml
from eitskin.errors import ConfigError, EitskinError, FileError, UsageError
from eitskin.fileio import parse_json, write_bytes
from eitskin.frames.arrays import read_npz
from eitskin.frames.frames import Frames
from eitskin.progress import Progress, silent
from eitskin.scene.compiler import compile_scene
from eitskin.scene.description import Scene
from eitskin.scene.runner import simulate_frames
from eitskin.scene.session import MeshCache
from eitskin.scene.truth import truth_of
from eitskin.skin.protocol import table as protocol_of_rows
from eitskin.skin.skin import skin_to_table
from eitskin_studies.datasets.ranges import Ranges, drawn, ranges_of
from eitskin_studies.harness.extras import missing_studies_extra

FORMAT = "eitskin-dataset"
VERSION = 1
DEFAULT_CHUNK = 100
MAX_SCENES = 100_000_000
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """A whole dataset: everything that a worker needs to make any chunk of it."""

    scene: Scene
    ranges: Ranges
    count: int
    seed: int
    chunk: int

    @property
    def chunks(self) -> int:
        """The number of chunks; the last may be shorter."""
        return -(-self.count // self.chunk)

    def numbers(self, chunk: int) -> range:
        """The numbers of the scenes in ``chunk``."""
        return range(chunk * self.chunk, min((chunk + 1) * self.chunk, self.count))

    def manifest(self) -> dict[str, Any]:
        """Return the content of ``dataset.json``; equal contents describe equal datasets."""
        content = {
            "skin": skin_to_table(self.scene.skin),
            "scene": repr(self.scene),
            "ranges": repr(self.ranges),
        }
        rows = hashlib.sha256(self.scene.protocol.drive_measure.tobytes()).hexdigest()
        digest = hashlib.sha256(
            (json.dumps(content, sort_keys=True) + rows).encode("utf-8")
        ).hexdigest()
        return {
            "format": FORMAT,
            "version": VERSION,
            "scene": self.scene.name,
            "text": self.scene.text,
            "count": self.count,
            "seed": self.seed,
            "scenes_a_chunk": self.chunk,
            "description_sha256": digest,
        }


def job_of(
    scene: Scene,
    count: int,
    seed: int,
    *,
    chunk: int = DEFAULT_CHUNK,
    ranges_file: Path | None = None,
) -> Job:
    """The dataset of ``count`` scenes drawn from ``scene``; ``ranges_file`` holds a [dataset] that
    replaces its own.

    Raises:
        UsageError: count, seed or chunk is out of range.
        FileError, ConfigError: the ranges cannot be read, or do not suit the scene.
    """
    for name, value, low, high in (
        ("--count", count, 1, MAX_SCENES),
        ("--chunk", chunk, 1, 100_000),
    ):
        if not low <= value <= high:
            raise UsageError(f"dataset: {name} {value} is out of range; use {low} to {high}")
    if seed < 0:
        raise UsageError(f"dataset: --seed {seed} must be 0 or above")
    own, where = scene.dataset, scene.where
    if ranges_file is not None:
        given, where = load_toml(ranges_file, "ranges file"), str(ranges_file)
        own = given.get("dataset", {})
        if set(given) != {"dataset"} or not isinstance(own, dict):
            raise ConfigError(f"{where}: a ranges file holds the table [dataset] and nothing else")
    ranges = ranges_of(own, scene, where)
    if ranges.touches is None and not ranges.numbers and not scene.effects:
        raise ConfigError(
            f"{where} [dataset]: nothing is drawn, so that all scenes would be equal; give ranges"
        )
    compile_scene(drawn(scene, ranges, seed, 0))
    return Job(scene, ranges, count, seed, chunk)


def make_chunk(job: Job, chunk: int, mesh_cache: MeshCache | None = None) -> bytes:
    """The .npz of one chunk: c scenes of f frames, t touches; every field is listed in
    docs/guide/scenes.md.

    Raises:
        EitskinError: a drawn scene cannot be; the text names its number.
    """
    mesh_cache = _own_mesh_cache() if mesh_cache is None else mesh_cache
    voltage, reference, seeds, touches, values = [], [], [], [], []
    for number in job.numbers(chunk):
        scene = drawn(job.scene, job.ranges, job.seed, number)
        compiled = compile_scene(scene, mesh_cache=mesh_cache)
        done = simulate_frames(compiled)
        voltage.append(done.voltage_v[scene.quiet_frames :])
        reference.append(done.voltage_v[: scene.quiet_frames].mean(axis=0))
        seeds.append(scene.seed)
        values.append([one.draw(job.seed, number) for one in job.ranges.numbers])
        truth = truth_of(compiled, 0)
        rows = [
            truth["touch_frame"],
            *truth["touch_xy_mm"].T,
            truth["touch_radius_mm"],
            truth["touch_strength"],
        ]
        touches.append(np.column_stack([np.full(len(rows[0]), len(seeds) - 1), *rows]))
    every = np.concatenate(touches)
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        format=np.array(FORMAT),
        version=np.array(VERSION, dtype=np.int32),
        first_scene=np.array(job.numbers(chunk).start, dtype=np.int64),
        seed=np.array(seeds, dtype=np.int64),
        voltage_v=np.array(voltage),
        reference_v=np.array(reference),
        time_s=job.scene.times_s(),
        drive_measure=job.scene.protocol.drive_measure,
        n_electrodes=np.array(job.scene.protocol.n_electrodes, dtype=np.int32),
        current_a=np.array(job.scene.protocol.current_a),
        touch_scene=every[:, 0].astype(np.int64),
        touch_frame=every[:, 1].astype(np.int64),
        touch_xy_mm=every[:, 2:4],
        touch_radius_mm=every[:, 4],
        touch_strength=every[:, 5],
        range_name=np.array([one.name for one in job.ranges.numbers], dtype=np.str_),
        range_value=np.array(values, dtype=np.float64).reshape(len(seeds), -1),
    )
    return stream.getvalue()


_MESH_CACHE: list[MeshCache] = []


def _own_mesh_cache() -> MeshCache:
    """This process's own meshes and models."""
    if not _MESH_CACHE:
        _MESH_CACHE.append(MeshCache())
    return _MESH_CACHE[0]


def chunk_path(folder: Path, chunk: int) -> Path:
    """Return the path of the file of ``chunk``."""
    return folder / f"chunk_{chunk:06d}.npz"


def write_dataset(
    job: Job,
    folder: Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress = silent,
) -> dict[str, int]:
    """Make the chunks that ``folder`` does not have yet; returns how many were made and how many
    were there.

    ``jobs`` processes work on this computer; with ``scheduler`` the Dask cluster at that address
    does instead. ``progress`` wraps the numbers of scenes as chunks are done, and is told how many
    scenes are to be made.

    Raises:
        UsageError: ``jobs`` is out of range, or the folder holds another dataset.
        FileError: the folder or a chunk cannot be written.
        MissingExtraError: a scheduler is given, and dask is not installed.
    """
    if not 1 <= jobs <= 1024:
        raise UsageError(f"dataset: --jobs {jobs} is out of range; use 1 to 1024")
    _open_folder(job, folder)
    missing = [chunk for chunk in range(job.chunks) if not chunk_path(folder, chunk).is_file()]
    if scheduler is not None:
        made = _over_dask(job, missing, scheduler)
    elif jobs == 1 or len(missing) < 2:
        made = ((chunk, make_chunk(job, chunk)) for chunk in missing)
    else:
        made = _over_processes(job, missing, jobs)

    def written() -> Iterator[int]:
        for chunk, content in made:
            write_bytes(chunk_path(folder, chunk), content)
            yield len(job.numbers(chunk))

    scenes = sum(len(job.numbers(chunk)) for chunk in missing)
    for _ in progress(written(), scenes):
        pass
    return {
        "chunks_made": len(missing),
        "chunks_kept": job.chunks - len(missing),
        "scenes_made": scenes,
    }


def _open_folder(job: Job, folder: Path) -> None:
    manifest, path = job.manifest(), folder / "dataset.json"
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: cannot make this folder ({error.strerror})") from None
    if not path.is_file():
        write_bytes(path, (json.dumps(manifest, indent=2) + "\n").encode("utf-8"))
        return
    try:
        there = parse_json(path.read_bytes())
    except (OSError, ValueError):
        there = None
    if there != manifest:
        differs = [
            key
            for key in manifest
            if not isinstance(there, dict) or there.get(key) != manifest[key]
        ]
        raise UsageError(
            f"{folder}: it holds another dataset ({', '.join(differs)} differ); name another"
            " folder, or remove this one"
        )


def _over_processes(job: Job, chunks: list[int], jobs: int) -> Iterator[tuple[int, bytes]]:
    """Chunks as they are done; at most two a process are under way, so that an interruption loses
    little."""
    with (
        _one_thread_each(),
        ProcessPoolExecutor(min(jobs, len(chunks)), mp_context=get_context("spawn")) as pool,
    ):
        waiting, running = list(reversed(chunks)), dict[Future[bytes], int]()
        try:
            while waiting or running:
                while waiting and len(running) < 2 * jobs:
                    chunk = waiting.pop()
                    running[pool.submit(make_chunk, job, chunk)] = chunk
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Child processes that start meanwhile use one thread each: their work is in many small
    solves."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _over_dask(job: Job, chunks: list[int], scheduler: str) -> Iterator[tuple[int, bytes]]:
    try:
        from dask.distributed import Client, as_completed
    except ImportError:
        raise missing_studies_extra("cluster", "dask[distributed]") from None
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise UsageError(
            f"--scheduler {scheduler}: no Dask scheduler answers there ({error}); check address"
        ) from None
    with client:
        futures = {client.submit(make_chunk, job, chunk, pure=False): chunk for chunk in chunks}
        for future, content in as_completed(futures, with_results=True):
            yield futures[future], content


def load_chunk(path: str | Path) -> dict[str, AnyArray]:
    """The arrays of one chunk.

    Raises:
        FileError: it cannot be read, or is no chunk of a dataset.
    """
    arrays = read_npz(path, "dataset chunk")
    if str(arrays.get("format")) != FORMAT or int(arrays.get("version", np.array(0))) != VERSION:
        raise FileError(
            f"{path}: not a chunk of an eitskin dataset of version {VERSION}; make it again"
        )
    return arrays


def frames_of(chunk: dict[str, AnyArray], number: int) -> Frames:
    """Scene ``number`` (from 0, in the chunk) as frames with truth, to be reconstructed like any
    others.

    Raises:
        UsageError: the chunk does not hold that many.
    """
    if not 0 <= number < len(chunk["seed"]):
        raise UsageError(
            f"dataset: scene {number} of a chunk of {len(chunk['seed'])}, counted from 0"
        )
    own = chunk["touch_scene"] == number
    try:
        protocol = protocol_of_rows(
            int(chunk["n_electrodes"]), chunk["drive_measure"], float(chunk["current_a"])
        )
    except EitskinError as error:
        raise type(error)(f"dataset chunk: {error}") from None
    return Frames(
        protocol=protocol,
        voltage_v=chunk["voltage_v"][number],
        reference_voltage_v=chunk["reference_v"][number],
        time_s=chunk["time_s"],
        **{
            name: chunk[name][own]
            for name in ("touch_frame", "touch_xy_mm", "touch_radius_mm", "touch_strength")
        },
        meta={"made_by": "eitskin dataset", "seed": int(chunk["seed"][number])},
    )
