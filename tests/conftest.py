"""Four tasks labelled by the real expert, made once, for everything that learns."""

from collections.abc import Callable
from pathlib import Path

import hypothesis
import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from omegaconf import DictConfig

from datasets.entry import CONFIGS
from datasets.generation import Generation, generate
from dlm.tasks import TaskBatch

torch.set_num_threads(
    1
)  # networks this small gain nothing from threads, and lose much where tests share cores

# The first example of a property may compile; no test asserts times on the clock.
hypothesis.settings.register_profile("untimed", deadline=None)
hypothesis.settings.load_profile("untimed")


@pytest.fixture(scope="session")
def composed() -> Callable[..., DictConfig]:
    """The configuration of a command with overrides: composed("train", "stage=nn")."""

    def configuration(command: str, *overrides: str) -> DictConfig:
        with initialize_config_dir(str(CONFIGS), version_base=None):
            return compose(command, overrides=list(overrides))

    return configuration


@pytest.fixture(scope="session")
def data_folder(composed: Callable[..., DictConfig], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds data/smoke-seed0, as `python -m datasets.generate dataset=smoke` makes it.  Not to be altered."""
    specification = instantiate(composed("generate", "dataset=smoke").dataset, _convert_="object")
    folder = tmp_path_factory.mktemp("learning")
    generate(Generation(specification=specification, seed=0, out=folder / "data" / "smoke-seed0", jobs=1))
    return folder


@pytest.fixture(scope="session")
def tasks(data_folder: Path) -> TaskBatch:
    """The four tasks as tensors."""
    return TaskBatch.read(data_folder / "data" / "smoke-seed0")
