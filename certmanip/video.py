"""From frames in memory, or a video file, to what two fingers have to do."""

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from certmanip.installation import explained, require_own_datasets
from expert.world.values import require

if TYPE_CHECKING:
    from dlm.infer import Inference, Segmentation


def infer(
    video: NDArray[np.uint8] | str | PathLike[str],
    *,
    fps: float | None = None,
    segmentation: "Segmentation | None" = None,
    refine: str | None = None,
    **given: Any,
) -> "Inference":
    """Positions and forces of two fingers that move the object as frames (T, height, width, 3), uint8 RGB, show.

    fps: frames per second, which an array needs; of a file, where it does not say.  given: what a video cannot say, `scale`
    [metres per pixel] or `object_size` [m], and `mass`, `friction`, `floor`, `duration` (dlm.infer.Given).
    The answer's `solution()` makes a case.  Raises InvalidProblem for a video without one object that stays in view, and
    IncompleteInstallation without the extra `learn`.
    """
    require_own_datasets()
    with explained():
        from dlm.infer import Clip, Given, VideoFile
        from dlm.infer import infer as infer_clip
        from dlm.perception.video import check_frames
        from dlm.structured import StructuredModel
    known: Any = Given(**given)
    if not isinstance(video, np.ndarray):
        source: Any = VideoFile(path=Path(video), rate=fps)
    else:
        require(
            fps is not None and 0 < fps < np.inf, "fps", "frames per second", fps, "an array has no times"
        )
        check_frames(video)
        steps = StructuredModel().planning.tasks.steps
        chosen = np.unique(np.linspace(0, len(video) - 1, steps).round().astype(int))
        source = Clip(frames=video[chosen], times=chosen / fps)
    return infer_clip(source, known, segmentation=segmentation, refine=refine)  # type: ignore[arg-type]
