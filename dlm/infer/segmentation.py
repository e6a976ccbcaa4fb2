"""Telling the object from its surroundings where colours alone do not: by a given colour, or by a picture without it.

Either way the frames are painted anew, plain object on plain ground, which is what perception expects.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
from PIL import Image

from datasets.limits import Number, check_numbers
from datasets.render import Frames, Palette, checked_colour
from expert.errors import InvalidProblem
from expert.world.values import require

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, kw_only=True)
class Segmentation:
    """colour: RGB of the object.  background: picture of the scene without it.  Neither: the frames are taken as they are.

    tolerance: greatest distance from the colour, or least from the background, that makes a pixel the object's [grey
    levels].  least: specks of fewer pixels than this share of the frame are left out.
    """

    colour: tuple[int, int, int] | None = None
    background: str | Path | None = None
    tolerance: Annotated[float, Number(unit="grey levels", above=0, most=441)] = 60.0
    least: Annotated[float, Number(least=0, most=1)] = 1e-3

    def __post_init__(self) -> None:
        both = self.colour is not None and self.background is not None
        require(not both, "segmentation", "colour or background", "both", "give one of them")
        check_numbers(self, "segmentation.")
        if self.colour is not None:
            object.__setattr__(self, "colour", checked_colour(self.colour, "segmentation.colour"))

    def paint(self, frames: Frames, floor: float) -> Frames:
        """Frames (T, h, w, 3) with a plain object, a plain background, and plain ground below row `floor`."""
        if self.colour is None and self.background is None:
            return frames
        palette = Palette()
        rows = np.clip(np.arange(1, frames.shape[1] + 1) - floor, 0, 1)[:, None, None]
        empty = np.array(palette.background) + rows * np.subtract(palette.ground, palette.background)
        painted = np.broadcast_to(empty, frames.shape).copy()
        painted[self.mask(frames)] = palette.object
        return np.rint(painted).astype(np.uint8)

    def mask(self, frames: Frames) -> Mask:
        """The object's pixels (T, h, w), freed of specks and holes."""
        if self.colour is not None:
            distance = np.linalg.norm(frames.astype(float) - np.array(self.colour, dtype=float), axis=-1)
            raw = distance < self.tolerance
        else:
            distance = np.linalg.norm(frames.astype(float) - self._empty(frames), axis=-1)
            raw = distance > self.tolerance
        return np.stack([self._clean(mask) for mask in raw])

    def _empty(self, frames: Frames) -> np.ndarray:
        try:
            with Image.open(str(self.background)) as picture:
                image = np.array(picture.convert("RGB"), dtype=float)
        except (OSError, SyntaxError) as error:
            raise InvalidProblem(
                "segmentation.background", expected="a picture", got=f"{self.background}, which is none"
            ) from error
        require(
            image.shape == frames.shape[1:],
            "segmentation.background",
            f"a picture of {frames.shape[2]} x {frames.shape[1]} pixels, as the video's",
            f"{image.shape[1]} x {image.shape[0]}",
        )
        return image

    def _clean(self, mask: Mask) -> Mask:
        """Pieces that are large enough, with their holes filled."""
        pieces, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
        large = [k for k in range(1, pieces) if stats[k, cv2.CC_STAT_AREA] >= self.least * mask.size]
        outlines, _ = cv2.findContours(
            np.isin(labels, large).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        filled = np.zeros(mask.shape, dtype=np.uint8)
        cv2.drawContours(filled, outlines, -1, 1, cv2.FILLED)
        return filled.astype(bool)
