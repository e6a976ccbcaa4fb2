"""Mechanical derendering: from video frames to mechanical parameters (Thesis 4-CT3, 4-CT4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn


@dataclass(frozen=True, kw_only=True)
class NetworkSizes:
    """Sizes of the thesis's networks; every fully connected hidden layer is as wide as its input."""

    channels: tuple[int, ...] = (6, 12, 24)
    latent: int = 75
    recurrent_layers: int = 5
    hidden_layers: int = 3
    dropout: float = 0.2


def mlp(inputs: int, outputs: int, sizes: NetworkSizes) -> nn.Sequential:
    """Perceptron over the last axis of (N, inputs) with batch norm, ReLU and dropout after each hidden layer."""
    hidden: list[nn.Module] = []
    for _ in range(sizes.hidden_layers):
        hidden += [
            nn.Linear(inputs, inputs),
            nn.BatchNorm1d(inputs),
            nn.ReLU(),
            nn.Dropout(sizes.dropout),
        ]
    return nn.Sequential(*hidden, nn.Linear(inputs, outputs))


class VideoEncoder(nn.Module):
    """4-CT3: L = LSTM(CNN(I_1), ..., CNN(I_T)), forwards and backwards in time."""

    def __init__(self, sizes: NetworkSizes, *, pixels: int = 50) -> None:
        super().__init__()
        steps = pairwise((3, *sizes.channels))
        layers = [[nn.Conv2d(i, o, 3, stride=2, padding=1), nn.ReLU()] for i, o in steps]
        self.cnn = nn.Sequential(*sum(layers, []), nn.Flatten())
        side = pixels
        for _ in sizes.channels:
            side = (side + 1) // 2
        self.lstm = nn.LSTM(
            sizes.channels[-1] * side**2,
            sizes.latent,
            sizes.recurrent_layers,
            batch_first=True,
            bidirectional=True,
        )
        self.join = nn.Linear(2 * sizes.latent, sizes.latent)

    def forward(self, video: Tensor) -> Tensor:
        """Frames (B, T, H, W, 3), uint8, to latents (B, T, latent)."""
        b, t = video.shape[:2]
        images = video.flatten(0, 1).permute(0, 3, 1, 2).float() / 255 - 0.5
        frames = self.cnn(images).unflatten(0, (b, t))
        return self.join(self.lstm(frames)[0])


class Derenderer(nn.Module):
    """4-CT4: P*(t) = MLP_P(L)(t), one head per kind of parameter, in standard units (mean 0, deviation 1)."""

    def __init__(self, widths: Mapping[str, int], sizes: NetworkSizes) -> None:
        super().__init__()
        self.encoder = VideoEncoder(sizes)
        self.heads = nn.ModuleDict({name: mlp(sizes.latent, n, sizes) for name, n in widths.items()})

    def forward(self, video: Tensor) -> dict[str, Tensor]:
        """Frames (B, T, H, W, 3) to standardised parameters by name, each (B, T, width), float32."""
        latent = self.encoder(video)
        rows = latent.flatten(0, 1)
        return {name: head(rows).unflatten(0, latent.shape[:2]) for name, head in self.heads.items()}


class Standardiser(nn.Module):
    """Affine map between physical values (B, T, width) and standard units, fitted to a training set and saved with the weights.

    Each step and coordinate has its own mean; one deviation per kind, so that metres weigh alike in all coordinates.
    """

    def __init__(self, widths: Mapping[str, int], steps: int) -> None:
        super().__init__()
        for name, width in widths.items():
            self.register_buffer(f"{name}_mean", torch.zeros(steps, width, dtype=torch.float64))
            self.register_buffer(f"{name}_scale", torch.ones((), dtype=torch.float64))

    def fit(self, values: Mapping[str, Tensor]) -> None:
        """Take mean and deviation over the tasks of a training set."""
        for name, value in values.items():
            mean = value.double().mean(0)
            self.get_buffer(f"{name}_mean").copy_(mean)
            scale = (value.double() - mean).square().mean().sqrt()
            self.get_buffer(f"{name}_scale").copy_(scale if scale > 1e-9 else torch.ones(()))

    def standard(self, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Physical values to standard units, float32."""
        return {
            name: (
                (value.double() - self.get_buffer(f"{name}_mean")) / self.get_buffer(f"{name}_scale")
            ).float()
            for name, value in values.items()
        }

    def physical(self, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Standard units to physical values, float64."""
        return {
            name: self.get_buffer(f"{name}_mean") + self.get_buffer(f"{name}_scale") * value.double()
            for name, value in values.items()
        }
