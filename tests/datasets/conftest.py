"""A small data set, made once by the real expert."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

from datasets.entry import CONFIGS
from datasets.generation import Generation, generate
from datasets.specification import Specification


@pytest.fixture(scope="session")
def configured() -> Callable[[str], Specification]:
    """The specification that the command line `dataset=<name>` gives."""

    def specification(name: str) -> Specification:
        with initialize_config_dir(str(CONFIGS), version_base=None):
            return instantiate(compose("generate", overrides=[f"dataset={name}"]).dataset, _convert_="object")

    return specification


@pytest.fixture(scope="session")
def smoke(configured: Callable[[str], Specification]) -> Specification:
    return configured("smoke")


@pytest.fixture(scope="session")
def small(smoke: Specification) -> Specification:
    """Six tasks, one of each family, in three shards."""
    return replace(smoke, count=6, shard=2)


@pytest.fixture(scope="session")
def made(small: Specification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the small data set, made without disturbance by one process.  Not to be altered."""
    folder = tmp_path_factory.mktemp("data") / "small"
    generate(Generation(specification=small, seed=0, out=folder, jobs=1))
    return folder


@pytest.fixture(scope="session")
def contents() -> Callable[[Path], dict[str, bytes]]:
    """Every file below a folder, by name."""
    return lambda folder: {
        str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }
