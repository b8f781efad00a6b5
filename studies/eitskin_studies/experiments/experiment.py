"""Experiments, and their workspace: seeded and resumable, with every result kept as soon as it is
computed."""

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from eitskin import __version__
from eitskin.arrays import AnyArray
from eitskin.core.engine import load_core
from eitskin.errors import FileError, UsageError
from eitskin.fileio import write_beside
from eitskin.progress import Progress
from eitskin.skin.protocol import Protocol as Scan
from eitskin.skin.skin import Skin
from eitskin_studies.harness.sessions import SceneSolver
from eitskin_studies.harness.store import Store, key_of

SIMULATED_ELEMENTS = 11_000
MODEL_ELEMENTS = 6_000


@dataclass(frozen=True)
class ExperimentSettings:
    """The size of an experiment.

    Attributes:
        seed: of the reported sets; sets for choosing have ``tuning_seed``, so that no number is
            reported on what was tuned on.
        share: of the usual number of scenes; 1 for what the pages show, less for a quick look.
        data: a folder of measured frames, for experiments on them; None where there is none.
    """

    seed: int = 1
    share: float = 1.0
    data: Path | None = None

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise UsageError(f"--seed {self.seed} must be 0 or above")
        if not 0 < self.share <= 100:
            raise UsageError(f"--share {self.share:g} is out of range; use above 0, to 100")

    @property
    def tuning_seed(self) -> int:
        """The seed of the sets on which parameters and thresholds are chosen."""
        return 100_000 + self.seed

    def count(self, usual: int, least: int = 2) -> int:
        """``usual`` scenes, or the share of them, at least ``least``."""
        return max(least, math.ceil(usual * self.share))


@dataclass(frozen=True)
class Table:
    """Numbers as words, a line each; ``name`` names the CSV file and the page's mark."""

    name: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class ExperimentOutcome:
    """The results of an experiment.

    Attributes:
        tables: each is printed, written as CSV, and put between the marks of its name on the page.
        data: everything, for JSON.
        pictures: file name to what draws it there.
        words: further text for the page, by mark: sentences with numbers in them.
    """

    tables: tuple[Table, ...]
    data: Mapping[str, Any]
    pictures: Mapping[str, Callable[[Path], None]] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)


@dataclass(eq=False)
class Workspace:
    """The workspace of an experiment: its settings, its folder, and the results that are kept
    there. Use :func:`workspace_in`."""

    settings: ExperimentSettings
    folder: Path
    progress: Progress
    store: Store

    @cached_property
    def world(self) -> dict[str, Any]:
        """Return what every result depends on. The core's own bytes are part of it, so that another
        build measures again."""
        core = hashlib.sha256(Path(load_core("float32").__file__).read_bytes()).hexdigest()[:16]
        return {"version": __version__, "core": core}

    def kept(self, facts: Mapping[str, Any], make: Callable[[], Any]) -> Any:
        """Return the JSON value that ``make`` gives for ``facts``. It is computed once and then
        read, in this run and in runs that continue it.

        ``facts`` must say all that the value depends on besides the code; the seed is added.

        Raises:
            FileError: the folder cannot be written.
        """
        whole = {**self.world, "seed": self.settings.seed, **facts}
        found = self.store.get(whole)
        return self.store.put(whole, make()) if found is None else found

    def kept_arrays(
        self, facts: Mapping[str, Any], make: Callable[[], Mapping[str, AnyArray]]
    ) -> dict[str, AnyArray]:
        """The same for named arrays, in a file of their own below the folder."""
        path = (
            self.folder
            / "arrays"
            / f"{key_of({**self.world, 'seed': self.settings.seed, **facts})}.npz"
        )
        if path.is_file():
            try:
                with np.load(path, allow_pickle=False) as archive:
                    return {name: archive[name] for name in archive.files}
            except (OSError, ValueError):
                pass
        made = dict(make())
        path.parent.mkdir(parents=True, exist_ok=True)
        with write_beside(path) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(stream, **made)  # type: ignore[arg-type]
        return made

    def scenes(self, skin: Skin, protocol: Scan, elements: int = SIMULATED_ELEMENTS) -> SceneSolver:
        """Return a solver of scenes on a mesh that no model uses; its solutions are kept in the
        folder."""
        return SceneSolver(skin, protocol, elements, self.folder / "frames")


class Experiment(Protocol):
    """A module with these: ``TITLE``, one line; ``run``, the whole experiment."""

    TITLE: str

    def run(self, workspace: Workspace) -> ExperimentOutcome:
        """Run the whole study; results that the workspace has kept are not computed again."""


def workspace_in(folder: Path, settings: ExperimentSettings, progress: Progress) -> Workspace:
    """A workspace in ``folder``, which is made.

    Raises:
        FileError: it cannot be made or read.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            f"{folder}: cannot make this folder ({error.strerror}); name another with -o"
        ) from None
    return Workspace(settings, folder, progress, Store(folder / "results.jsonl"))
