"""The learned method of ``eitskin compare``: turned scenes, training, and what it refuses."""

import numpy as np
import pytest

from eitskin.errors import FileError, UsageError
from eitskin.scoring.metrics import pixel_cover
from eitskin.skin.protocol import adjacent, table
from eitskin.skin.skin import paper_skin
from eitskin_studies.compare.families import setup_for
from eitskin_studies.compare.learned import Network, learned_family, turned_rows


@pytest.fixture(scope="module")
def setup():
    return setup_for(paper_skin(), adjacent(16), elements=1200, pixels_across=12)


def test_a_turned_scan_is_the_scan_of_turned_touches(setup):
    turns = turned_rows(setup.protocol)
    assert sorted(turns) == list(range(16))
    # a touch at the place of electrode 0, seen through electrodes turned by 4: that of electrode 4
    at = [setup.skin.electrode_centres_mm()[k] * 0.5 for k in (0, 4)]
    frame, expected = (setup.jacobian @ pixel_cover(setup.grid, [place], [9.0]) for place in at)
    turned = np.empty_like(frame)
    turned[turns[4]] = frame
    assert np.abs(turned - expected).max() < 0.05 * np.abs(expected).max()
    assert turned_rows(table(16, adjacent(16).drive_measure[:100])) == {}


def write_chunk(folder, setup, count=24):
    generator = np.random.default_rng(1)
    places = generator.uniform(-50, 50, (count, 2))
    covers = np.array([pixel_cover(setup.grid, [place], [12.0]) for place in places])
    np.savez(
        folder / "chunk_000000.npz",
        format=np.array("eitskin-dataset"),
        version=np.array(1, dtype=np.int32),
        voltage_v=(covers @ setup.jacobian.T)[:, None],
        reference_v=np.zeros((count, 208)),
        drive_measure=setup.protocol.drive_measure,
        touch_scene=np.arange(count),
        touch_xy_mm=places,
        touch_radius_mm=np.full(count, 12.0),
    )
    return covers


def test_a_trained_network_shows_its_touches(setup, tmp_path):
    covers = write_chunk(tmp_path, setup)
    family = learned_family(setup, tmp_path)
    network = family.make(family.values[0])
    assert isinstance(network, Network)
    assert network.macs == 208 * 128 + 128 * setup.grid.n_pixels
    frames = covers @ setup.jacobian.T
    images = network.reconstruct(frames)
    alike = [np.corrcoef(image, cover)[0, 1] for image, cover in zip(images, covers, strict=True)]
    assert np.median(alike) > 0.4
    assert np.array_equal(network.reconstruct(3 * frames), network.reconstruct(3.0 * frames))
    assert np.isfinite(network.reconstruct(np.zeros((1, 208)))).all()


def test_what_is_no_dataset_of_this_scan_is_refused(setup, tmp_path):
    with pytest.raises(FileError, match="holds no chunk"):
        learned_family(setup, tmp_path)
    write_chunk(tmp_path, setup_for(paper_skin(), adjacent(16), elements=1200, pixels_across=12))
    path = tmp_path / "chunk_000000.npz"
    arrays = dict(np.load(path))
    np.savez(path, **{**arrays, "drive_measure": arrays["drive_measure"][::-1]})
    with pytest.raises(UsageError, match="another protocol"):
        learned_family(setup, tmp_path)
