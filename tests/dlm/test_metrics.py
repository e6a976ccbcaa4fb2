"""The metric by hand, in both array libraries."""

import numpy as np
import pytest
import torch

from dlm.metrics import (
    finger_trajectory_loss,
    object_trajectory_loss,
    rms_errors,
    rotation_error,
    translation_error,
    within,
)


def test_a_centimetre_in_one_coordinate_is_a_third_of_a_square_centimetre():
    desired = np.zeros((2, 5, 3))
    shifted = desired + [0.01, 0, 0]
    np.testing.assert_allclose(object_trajectory_loss(shifted, desired), 1 / 3)
    assert object_trajectory_loss(torch.tensor(shifted), torch.tensor(desired)).tolist() == pytest.approx(
        [1 / 3] * 2
    )


def test_rotation_counts_by_three_centimetres_of_sine():
    desired, turned = np.zeros((5, 3)), np.zeros((5, 3))
    turned[-1, 2] = 0.2
    assert object_trajectory_loss(turned, desired) == pytest.approx((3 * np.sin(0.2)) ** 2 / 15)


def test_finger_loss_is_a_mean_over_all_coordinates():
    assert finger_trajectory_loss(np.full((5, 2, 2), 0.02), np.zeros((5, 2, 2))) == pytest.approx(4)


def test_final_errors_and_the_bar():
    desired, got = np.zeros((3, 5, 3)), np.zeros((3, 5, 3))
    got[0, -1] = [0.003, 0.004, 0]
    got[1, -1] = [0.001, 0, np.radians(359)]
    got[2, 0] = [1, 1, 1]
    np.testing.assert_allclose(translation_error(got, desired)[:, -1], [5, 1, 0])
    np.testing.assert_allclose(rotation_error(got, desired)[:, -1], [0, 1, 0], atol=1e-9)
    assert within(got, desired).tolist() == [False, True, True]
    assert within(torch.tensor(got), torch.tensor(desired), mm=6).tolist() == [True, True, True]


def test_rms_over_frames():
    desired, got = np.zeros((4, 3)), np.zeros((4, 3))
    got[:, 0] = [0, 0.001, 0.001, 0]
    mm, deg = rms_errors(got, desired)
    assert mm == pytest.approx(np.sqrt(0.5))
    assert deg == 0
