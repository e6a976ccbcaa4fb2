import pytest

from dlm.thesis.losses import ParameterLoss
from dlm.training.stage import Schedule, Stage
from expert.errors import InvalidProblem


@pytest.mark.parametrize(
    ("name", "value"),
    [("iterations", 0), ("batch_size", 1), ("learning_rate", -1.0), ("save_every", 0), ("decay", "linear")],
)
def test_a_schedule_refuses_what_makes_no_sense(name: str, value: float | str) -> None:
    with pytest.raises(InvalidProblem, match=f"{name}: expected"):
        Schedule(**{name: value})  # type: ignore[arg-type]
    with pytest.raises(InvalidProblem, match=f"{name}: expected"):
        stage(**{name: value}).scheduled(Schedule())


def stage(**schedule: float | str) -> Stage:
    return Stage(name="dlm", policy="program", loss=ParameterLoss(), dataset="train", schedule=schedule)


def test_a_stage_changes_what_it_names_of_the_common_schedule() -> None:
    common = Schedule(iterations=7, seed=3)
    assert stage().scheduled(common) == common
    own = stage(batch_size=9, learning_rate=0.25).scheduled(common)
    assert own == Schedule(iterations=7, seed=3, batch_size=9, learning_rate=0.25)


def test_the_rate_stays_or_falls_along_half_a_cosine() -> None:
    shares = (0.0, 0.5, 1.0)
    assert [Schedule(learning_rate=0.25).rate(x) for x in shares] == [0.25] * 3
    falling = Schedule(learning_rate=0.25, decay="cosine")
    assert [falling.rate(x) for x in shares] == pytest.approx([0.25, 0.125, 0.0])
    assert falling.rate(0.25) > 0.25 * 0.75 > falling.rate(0.5)
