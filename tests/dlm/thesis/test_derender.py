import pytest
import torch
from torch import nn

from dlm.inverse_dynamics.parameters import FLAGS, Layout
from dlm.tasks import TaskBatch
from dlm.thesis.derender import Derenderer, NetworkSizes, VideoEncoder, perceptron

SIZES = NetworkSizes()


def test_sizes_are_those_of_the_thesis() -> None:
    encoder = VideoEncoder(SIZES)
    convolutions = [m.out_channels for m in encoder.modules() if isinstance(m, nn.Conv2d)]
    assert convolutions == [6, 12, 24]
    assert (encoder.lstm.num_layers, encoder.lstm.bidirectional) == (5, True)
    head = perceptron(75, 8, SIZES)
    linear = [(m.in_features, m.out_features) for m in head if isinstance(m, nn.Linear)]
    assert linear == [(75, 75)] * 3 + [(75, 8)]
    assert [m.p for m in head if isinstance(m, nn.Dropout)] == [0.2] * 3
    assert sum(isinstance(m, nn.BatchNorm1d) for m in head) == 3


def test_the_latent_of_a_frame_depends_on_earlier_and_later_frames() -> None:
    encoder = VideoEncoder(SIZES).eval()
    video = torch.randint(0, 255, (1, 5, 50, 50, 3), dtype=torch.uint8)
    for changed in (0, 4):
        other = video.clone()
        other[:, changed] = 255 - other[:, changed]
        difference = (encoder(video) - encoder(other)).abs().amax(-1)[0]
        assert (difference > 0).all()
    assert encoder(video).shape == (1, 5, 75)


def test_an_untrained_derenderer_is_centred_on_the_mean_task(tasks: TaskBatch) -> None:
    derenderer = Derenderer(Layout(), SIZES).eval()
    derenderer.fit_centre(tasks.parameters)
    for head in derenderer.heads.values():
        nn.init.zeros_(head[-1].weight)
        nn.init.zeros_(head[-1].bias)
    guess = derenderer.parameters_of(tasks.video)
    for name, value in tasks.parameters.named().items():
        mean = value.mean(0).expand_as(value)
        tolerance = 0.021 if name in FLAGS else 1e-5  # flags keep off 0 and 1
        torch.testing.assert_close(getattr(guess, name), mean, atol=tolerance, rtol=1e-5)


def test_flags_stay_between_0_and_1(tasks: TaskBatch) -> None:
    derenderer = Derenderer(Layout(), SIZES)
    P = derenderer.parameters_of(tasks.video)
    for flag in (getattr(P, name) for name in FLAGS):
        assert flag.min() >= 0
        assert flag.max() <= 1


@pytest.mark.parametrize("pixels", [32, 50, 64])
def test_any_frame_size(pixels: int) -> None:
    encoder = VideoEncoder(NetworkSizes(pixels=pixels))
    video = torch.zeros(1, 2, pixels, pixels, 3, dtype=torch.uint8)
    assert encoder(video).shape == (1, 2, 75)
