"""Mechanical derendering: from video frames to mechanical parameters (Thesis 4-CT3, 4-CT4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from math import ceil, prod
from typing import Annotated

import torch
from torch import Tensor, nn

from datasets.limits import Number, check_numbers
from dlm.inverse_dynamics.parameters import FLAGS, Layout, ParameterBatch
from expert.world.values import require


@dataclass(frozen=True, kw_only=True)
class NetworkSizes:
    """Sizes of the thesis's networks; every fully connected hidden layer is as wide as its input."""

    channels: tuple[int, ...] = (6, 12, 24)
    latent: Annotated[int, Number(whole=True, least=1, most=10**5)] = 75
    recurrent_layers: Annotated[int, Number(whole=True, least=1, most=100)] = 5
    hidden_layers: Annotated[int, Number(whole=True, least=0, most=100)] = 3
    dropout: Annotated[float, Number(least=0, most=0.99)] = 0.2
    pixels: Annotated[int, Number(whole=True, least=4, most=4096)] = 50
    steps: Annotated[int, Number(whole=True, least=3, most=1001)] = 5

    def __post_init__(self) -> None:
        check_numbers(self, "model.sizes.")
        numbers = self.channels if isinstance(self.channels, Sequence) else ()
        fits = len(numbers) > 0 and all(Number(whole=True, least=1, most=10**4).holds(n) for n in numbers)
        require(fits, "model.sizes.channels", "whole numbers of at least 1", self.channels)
        object.__setattr__(self, "channels", tuple(numbers))


def perceptron(inputs: int, outputs: int, sizes: NetworkSizes) -> nn.Sequential:
    """Map of rows (n, inputs) to (n, outputs); batch norm, ReLU and dropout after each hidden layer.

    The last layer starts at zero: what an untrained perceptron adds to a mean answer is nothing rather than noise.
    """
    hidden = [
        (nn.Linear(inputs, inputs), nn.BatchNorm1d(inputs), nn.ReLU(), nn.Dropout(sizes.dropout))
        for _ in range(sizes.hidden_layers)
    ]
    last = nn.Linear(inputs, outputs)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(*chain.from_iterable(hidden), last)


class VideoEncoder(nn.Module):
    """4-CT3: L = LSTM(CNN(I_1), ..., CNN(I_T)), forwards and backwards in time."""

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        channels = pairwise((3, *sizes.channels))
        layers = [(nn.Conv2d(i, o, 3, stride=2, padding=1), nn.ReLU()) for i, o in channels]
        self.cnn = nn.Sequential(*chain.from_iterable(layers), nn.Flatten())
        side = ceil(sizes.pixels / 2 ** len(sizes.channels))
        self.lstm = nn.LSTM(
            sizes.channels[-1] * side**2,
            sizes.latent,
            sizes.recurrent_layers,
            batch_first=True,
            bidirectional=True,
        )
        self.join = nn.Linear(2 * sizes.latent, sizes.latent)

    def forward(self, video: Tensor) -> Tensor:
        """Frames (b, t, h, w, 3), uint8, to latents (b, t, latent), float32."""
        images = video.flatten(0, 1).permute(0, 3, 1, 2).float() / 255 - 0.5
        frames = self.cnn(images).unflatten(0, video.shape[:2])
        return self.join(self.lstm(frames)[0])


class Derenderer(nn.Module):
    """4-CT4: P*(t) = MLP_P(L)(t), one head per field of P.

    The heads give the deviation from the mean parameters of the training set (`centre`, saved with the weights),
    so that an untrained network starts from an average task.
    """

    centre: Tensor

    def __init__(self, layout: Layout, sizes: NetworkSizes) -> None:
        super().__init__()
        self.layout = layout
        self.encoder = VideoEncoder(sizes)
        widths = {name: prod(shape) for name, shape in layout.shapes.items()}
        self.heads = nn.ModuleDict({n: perceptron(sizes.latent, w, sizes) for n, w in widths.items()})
        self.register_buffer("centre", torch.zeros(sizes.steps, layout.width))

    def fit_centre(self, parameters: ParameterBatch) -> None:
        """Take the mean over the tasks of a training set; flags in logits."""
        mean = self.layout.split(self.layout.flatten(parameters).mean(0))
        rows = [x.logit(eps=0.02) if name in FLAGS else x for name, x in mean.items()]
        self.centre.copy_(torch.cat([x.flatten(1) for x in rows], dim=-1))

    def forward(self, video: Tensor) -> Tensor:
        """Frames (b, t, h, w, 3) to rows (b, t, width) of the layout, float32: scaled, flags from 0 to 1."""
        rows = self.encoder(video).flatten(0, 1)
        deviation = torch.cat([head(rows) for head in self.heads.values()], dim=-1)
        return self.layout.squash(self.centre + deviation.unflatten(0, video.shape[:2]))

    def parameters_of(self, video: Tensor) -> ParameterBatch:
        """P* of each video, SI units, float64."""
        return self.layout.unflatten(self(video).double())
