from dlm.inverse_dynamics.diffcp import DiffcpClarabel
from tests.support.programs import assert_clips


def test_a_program_with_a_known_answer_and_one_without() -> None:
    assert_clips(DiffcpClarabel())
