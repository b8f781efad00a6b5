"""Single, double and triple touch by every method (the paper's Figs. 7 and 8), at fixed parameters
and at each one's best."""

from eitskin.skin.protocol import adjacent
from eitskin.skin.skin import paper_skin
from eitskin_studies.experiments.algorithms.candidates import candidates
from eitskin_studies.experiments.algorithms.drawn import drawings
from eitskin_studies.experiments.algorithms.measure import Field
from eitskin_studies.experiments.algorithms.results import result_of
from eitskin_studies.experiments.algorithms.tables import data, tables, words
from eitskin_studies.experiments.experiment import ExperimentOutcome, Workspace

TITLE = "Single, double and triple touch by every method"
TEST_SCENES, TUNING_SCENES = 60, 20


def run(workspace: Workspace) -> ExperimentOutcome:
    """All methods on all sets.

    Raises:
        UsageError: the C core is not built.
        FileError: the workspace's folder cannot be written.
        GeometryError, MissingExtraError: from meshing and simulating.
    """
    count = workspace.settings.count
    field = Field(workspace, paper_skin(), adjacent(16), count(TUNING_SCENES), count(TEST_SCENES))
    results = [
        result_of(field, candidate) for candidate in workspace.progress(candidates(), "methods")
    ]
    drawn = drawings(results, workspace.settings.seed)
    return ExperimentOutcome(tables(results), data(field, results), drawn, words(field, results))
