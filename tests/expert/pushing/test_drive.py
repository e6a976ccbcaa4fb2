import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from expert.errors import InvalidProblem
from expert.pushing.drive import Drive, gains, substep_map

DRIVE = Drive()
points = st.tuples(st.floats(0, 500), st.floats(0, 500)).map(np.array)


def carried_out(commands, position, velocity):
    """Positions (n, 2) after each step, and the last velocity, substep by substep."""
    places = []
    for command in commands:
        for _ in range(DRIVE.substeps):
            velocity = velocity + DRIVE.dt * (
                DRIVE.stiffness * (command - position) - DRIVE.damping * velocity
            )
            position = position + DRIVE.dt * velocity
        places.append(position)
    return np.array(places), velocity


@given(points, points, points, points)
def test_commands_end_at_rest_at_the_goal_by_way_of_the_points(start, velocity, end, via):
    commands = DRIVE.commands(5, start, velocity, end, {2: via})
    places, speed = carried_out(commands, start, velocity)
    assert places[-1] == pytest.approx(end, abs=1e-6)
    assert speed == pytest.approx([0, 0], abs=1e-5)
    assert places[1] == pytest.approx(via, abs=1e-6)


def test_one_step_is_the_substeps_one_after_the_other():
    p, v, u = np.array([10.0, 20.0]), np.array([300.0, -50.0]), np.array([80.0, 5.0])
    places, speed = carried_out(u[None], p, v)
    position, velocity = DRIVE.after(p, v, u)
    assert position == pytest.approx(places[0])
    assert velocity == pytest.approx(speed)


def accelerations(commands):
    """From rest at 0, along one axis."""
    a, b = substep_map(DRIVE)
    state, found = np.zeros(2), []
    for command in np.repeat(commands, DRIVE.substeps):
        new = a @ state + b * command
        found.append(new[1] - state[1])
        state = new
    return np.array(found)


def test_no_other_commands_to_the_same_end_accelerate_less():
    commands = gains(DRIVE, 5, ())[:, 2]
    least = (accelerations(commands) ** 2).sum()
    a, b = substep_map(DRIVE)
    powers = [np.linalg.matrix_power(a, k) @ b for k in range(50)]
    response = np.array([sum(powers[50 - 10 * (i + 1) : 50 - 10 * i]) for i in range(5)]).T
    for kept in np.linalg.svd(response)[2][2:]:  # changes that leave the end as it is
        for amount in (-0.01, 0.01):
            assert (accelerations(commands + amount * kept) ** 2).sum() > least


def test_too_few_steps_are_refused():
    with pytest.raises(InvalidProblem, match="steps"):
        gains(DRIVE, 2, (1,))
    with pytest.raises(InvalidProblem, match="via"):
        gains(DRIVE, 4, (4,))
