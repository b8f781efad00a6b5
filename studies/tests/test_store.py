"""Results that are kept a line each: a run goes on from any of them, whole or damaged."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from eitskin_studies.harness.store import Store

KEPT = b'{"key": "a", "values": {"x": 1}}\n{"key": "b", "values": [1, 2, null]}\n'
PLACE = st.integers(0, len(KEPT))


@given(cut=PLACE, end=PLACE, inserted=st.binary(max_size=16))
@settings(
    max_examples=150,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_a_run_goes_on_from_any_store(tmp_path, cut, end, inserted):
    path = tmp_path / "store.jsonl"
    path.write_bytes(KEPT[:cut] + inserted + KEPT[end:])
    Store(path).put({"a": 1}, [1.5])
    assert Store(path).get({"a": 1}) == [1.5]
