"""What a picture shows: where its colours are."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from expert.drawing.canvas import Image8, pixels
from expert.geometry.pose import Array


def frames_of(path: Path) -> list[Image8]:
    """All frames (height, width, 3) of a file."""
    frames = []
    with Image.open(path) as image:
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB")))
    return frames


def coloured(image: Image8, colour: str, tolerance: int = 24) -> np.ndarray:
    """Which pixels (height, width) have about this colour."""
    wanted = np.round(255 * np.array(to_rgb(colour)))
    return np.abs(image.astype(int) - wanted).max(axis=-1) <= tolerance


def shown_at(figure: Figure, axes: Axes, points: Array) -> tuple[Image8, np.ndarray]:
    """The figure as an image, and the pixels (row, column) of points (n, 2) in the data of one of its axes."""
    image = pixels(figure)
    x, y = axes.transData.transform(points).T
    return image, np.column_stack([len(image) - 1 - np.round(y).astype(int), np.round(x).astype(int)])


def texts(figure: Figure) -> list[str]:
    """All words in a figure, titles and legends too."""
    words = [t.get_text() for axes in figure.axes for t in [axes.title, *axes.texts]]
    words += [t.get_text() for legend in figure.legends for t in legend.get_texts()]
    return [word for word in [figure.get_suptitle(), *words] if word]
