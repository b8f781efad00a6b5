"""Example scenes for the picture: truth, the core's image and touches, Gauss-Newton's image and the
touches read off it."""

from dataclasses import asdict, dataclass, replace

import numpy as np

from eitskin.arrays import AnyArray, FloatArray
from eitskin.errors import GeometryError
from eitskin.model.options import default_options
from eitskin.scene.random_touches import TouchScene
from eitskin.solve.reconstructor import Reconstructor
from eitskin_studies.experiments.experiment import Workspace
from eitskin_studies.experiments.multitouch.cells import NARROW, RING, WIDE, Cell, counting_cells
from eitskin_studies.experiments.multitouch.test_data import CLASSICAL, HEADLINE_DB, TouchData
from eitskin_studies.experiments.multitouch.variants import (
    VARIANTS,
    TrainedMethod,
    differences_v,
    read_images,
)

EXAMPLES = (
    (RING, 7),
    (RING, 10),
    (WIDE, 6),
    (WIDE, 8),
    (NARROW, 3),
    (NARROW, 5),
    (NARROW, 8),
    (WIDE, 12),
)
SCENE = 0  # the first of each set, so that none was picked for its looks


@dataclass(frozen=True, eq=False)
class Example:
    """Images (n,) on the grid of 32 pixels across; found (t, 3): x, y and radius in mm; classical
    (t, 2)."""

    title: str
    scene: TouchScene
    image: FloatArray
    found: FloatArray
    said: bool
    classical_image: FloatArray
    classical: FloatArray


def gallery(touch_data: TouchData, workspace: Workspace) -> list[Example]:
    """The first scene of each of ``EXAMPLES``, at 60 dB; what does not fit on the skin is left
    out."""
    usual = {(cell.geometry, cell.touches): cell for cell in counting_cells()}
    found = []
    for geometry, touches in EXAMPLES:
        cell = usual[geometry, touches]
        try:
            scene = touch_data.scenes(cell).scenes[SCENE]
        except GeometryError:
            continue
        trained = touch_data.trained(CLASSICAL[0])

        def make(cell: Cell = cell, trained: TrainedMethod = trained) -> dict[str, AnyArray]:
            measured, grid = touch_data.session(cell).measured(HEADLINE_DB), touch_data.setup.grid
            model = touch_data.model(VARIANTS[0])
            solver = Reconstructor(
                model, options=replace(default_options(model), **VARIANTS[0].options)
            )
            solver.tare(measured.untouched_v)
            result = solver.reconstruct(measured.frames_v[SCENE, -1])
            method, frame = (
                touch_data.method(CLASSICAL[0]),
                differences_v(measured)[SCENE : SCENE + 1],
            )
            return {
                "image": np.asarray(result.image, dtype=np.float64),
                "found": (
                    np.array([(t.x_mm, t.y_mm, t.radius_mm) for t in result.touches]).reshape(-1, 3)
                ),
                "said": np.array("crowded" in result.info.diagnostics_by_name),
                "classical_image": method.reconstruct(frame)[0],
                "classical": read_images(
                    method, frame, trained.threshold, grid.index, grid.centres_mm()
                )[0],
            }

        facts = {
            **touch_data.facts("gallery", cell, HEADLINE_DB, False),
            **VARIANTS[0].facts(),
            **asdict(trained),
        }
        a = workspace.kept_arrays(facts, make)
        title = f"{geometry}, {touches}"
        found.append(
            Example(
                title,
                scene,
                a["image"],
                a["found"],
                bool(a["said"]),
                a["classical_image"],
                a["classical"],
            )
        )
    return found
