"""Any bytes as results of the trade-off, as a run to go on from, as a firmware image: read, passed
over, or refused."""

import json

from bytes_damage import ODD_BYTES, ODD_WORDS, any_bytes, bounded, read_or_refuse, written
from hypothesis import given

from eitskin.device.flash import check_image
from eitskin.firmware.prebuilt import load_image
from eitskin.tuning.front import load_front
from eitskin_studies.harness.store import Store
from eitskin_studies.tradeoff.fronts import as_dict, recorded_front

WORDS = ODD_BYTES + ODD_WORDS


def small_front() -> bytes:
    """The recorded results, of two configurations only."""
    whole = as_dict(recorded_front())
    return json.dumps({**whole, "points": whole["points"][:2]}).encode()


FRONT = small_front()
STORE = b'{"key": "a", "values": {"x": 1}}\n{"key": "b", "values": [1, 2, null]}\n'
IMAGE = load_image()[0][:4096]


@given(content=any_bytes([FRONT], WORDS))
@bounded(200)
def test_any_results_of_the_trade_off_are_read_or_refused(tmp_path, content):
    path = written(tmp_path, "front.json", content)
    front = read_or_refuse(load_front, path)
    if front is not None:
        json.dumps(as_dict(front))


@given(content=any_bytes([STORE], WORDS))
@bounded(150)
def test_a_run_goes_on_from_any_store(tmp_path, content):
    store = read_or_refuse(Store, written(tmp_path, "store.jsonl", content))
    assert store is not None
    store.put({"a": 1}, [1.5])
    assert Store(tmp_path / "store.jsonl").get({"a": 1}) == [1.5]


@given(content=any_bytes([IMAGE]))
@bounded(60)
def test_any_firmware_image_is_checked_or_refused(tmp_path, content):
    read_or_refuse(check_image, tmp_path / "x.bin", content)
