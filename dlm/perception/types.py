"""What perception is told, and what it answers."""

from dataclasses import dataclass
from typing import Annotated, Literal

from datasets.limits import Number, check_numbers
from expert.geometry.pose import Array

Status = Literal["ok", "poor_fit"]


@dataclass(frozen=True, kw_only=True)
class PerceptionSettings:
    """floor: the object may touch, and never enters, the floor y = 0.

    blur: standard deviation of the camera's known blur [pixels].  most_vertices: corners of the first outline, from
    which needless ones are removed.  snap: vertices within this distance of the floor may be taken to touch it, and to
    stay where they are if they move along it by less [pixels]; the data decides.  tolerance: the model's rms error
    over the noise beyond which a fit is called poor, in units of the noise plus 4 grey levels.  codec: errors that
    compression left near edges, where no plain background tells of them; added to the noise [grey levels].
    """

    floor: bool = True
    blur: Annotated[float, Number(unit="pixels", least=0, most=5)] = 0.0
    codec: Annotated[float, Number(unit="grey levels", least=0, most=100)] = 0.0
    most_vertices: Annotated[int, Number(whole=True, least=3, most=64)] = 16
    snap: Annotated[float, Number(unit="pixels", least=0, most=2)] = 0.25
    tolerance: Annotated[float, Number(above=0)] = 2.0

    def __post_init__(self) -> None:
        check_numbers(self, "perception.")


@dataclass(frozen=True, kw_only=True)
class Perceived:
    """A polygon and its motion, as the labels of a data set describe them.

    vertices: (V, 2) [m], body frame: its origin is the centroid (the centre of mass of a uniform plate), its axes are
    the world's at step 0; counter-clockwise, vertex 0 lies lowest, then leftmost, at step 0.
    poses: (T, 3) [m, m, rad], world frame; poses[0, 2] = 0, angles go on from step to step without jumps of 2 pi.
    residual: rms difference between video and model around the outline [grey levels, 0 to 255].
    status: ok, or poor_fit where the model does not explain the video; `reason` says why.  noise [grey levels].
    """

    vertices: Array
    poses: Array
    residual: float
    noise: float
    status: Status = "ok"
    reason: str = ""
