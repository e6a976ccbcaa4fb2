import pytest

from dlm.perception import PerceptionSettings
from expert.errors import InvalidProblem


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"blur": -1.0}, "perception.blur"),
        ({"most_vertices": 2}, "perception.most_vertices"),
        ({"snap": float("nan")}, "perception.snap"),
        ({"tolerance": 0.0}, "perception.tolerance"),
    ],
)
def test_senseless_settings_are_refused_by_name(change: dict, field: str) -> None:
    with pytest.raises(InvalidProblem, match=f"^{field}: expected "):
        PerceptionSettings(**change)
