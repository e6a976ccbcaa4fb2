"""What can be wrong with an installation, each in one line with its remedy: an extra that is missing, another `datasets`."""

import contextlib
import importlib.util
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

NAME = "certified-manipulation"
EXTRAS = {
    "learn": (
        "torch", "cvxpylayers", "diffcp", "piqp", "hydra", "omegaconf", "tensorboard", "cv2", "safetensors",
        "joblib", "jinja2", "threadpoolctl",
    ),
    "mujoco": ("mujoco",),
    "pusht": ("gymnasium", "pymunk", "pygame"),
    "ray": ("ray",),
    "gurobi": ("gurobipy",),
    "outlines": ("svgpathtools", "ezdxf"),
}  # fmt: skip
"""Modules that each extra brings."""
PACKAGES = Path(__file__).resolve().parent.parent
"""Folder that holds expert, datasets, dlm and certmanip."""


class IncompleteInstallation(ImportError):
    """Something that was asked for is not installed, or another package is in its place.  One line."""


@contextlib.contextmanager
def explained() -> Iterator[None]:
    """Turn a failing import of an optional package into IncompleteInstallation."""
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        extra = next((extra for extra, modules in EXTRAS.items() if missing in modules), None)
        if extra is None:
            raise
        raise IncompleteInstallation(
            f"{missing}: expected to be installed, got nothing; pip install '{NAME}[{extra}]'",
            name=error.name,
        ) from error


def require_own_datasets() -> None:
    """Raise IncompleteInstallation where `import datasets` gives another package, such as Hugging Face's of that name."""
    remedy = f"install {NAME} into an environment of its own, without the other"
    spec = importlib.util.find_spec("datasets")
    found = Path(spec.origin).resolve().parent if spec and spec.origin else None
    if found != PACKAGES / "datasets":
        where = found or "none"
        raise IncompleteInstallation(
            f"datasets: expected {NAME}'s, in {PACKAGES}, got another, in {where}; {remedy}"
        )
    with contextlib.suppress(metadata.PackageNotFoundError):
        other = metadata.distribution("datasets")
        if Path(str(other.locate_file("datasets"))).resolve() == found:
            raise IncompleteInstallation(
                f"datasets: expected {NAME}'s alone, got Hugging Face's datasets {other.version} in the same folder; {remedy}"
            )
