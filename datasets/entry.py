"""Hydra entry points that end with one line and a telling exit code: 2 for bad input, 130 when interrupted."""

import functools
import os
import sys
from collections.abc import Callable
from typing import Any, ParamSpec

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, ListConfig
from omegaconf.errors import OmegaConfBaseException

from expert.errors import ExpertError, InvalidProblem
from expert.shipped import CONFIGS
from expert.world.values import require

BAD_INPUT, FAILED, INTERRUPTED = 2, 1, 130

P = ParamSpec("P")
Job = Callable[[DictConfig], None]


def entry_point(config: str) -> Callable[[Job], Callable[[], None]]:
    """Make `job` a command configured by configs/<config>.yaml and the overrides of its command line."""

    def decorate(job: Job) -> Callable[[], None]:
        command = hydra.main(version_base=None, config_path=str(CONFIGS), config_name=config)(_one_line(job))
        return _one_line(command)

    return decorate


def listed(value: Any, field: str, example: str) -> list[Any]:
    """The entries of an option that takes several; one by itself counts as a list.  Raises InvalidProblem for none."""
    several = list(value) if isinstance(value, ListConfig) else [value]
    require(len(several) > 0 and value is not None, field, f"at least one of {field}", value, example)
    return several


def swept(*named: str) -> str:
    """Of a multirun's job: the swept overrides that tell it from the others, as part of a name; empty otherwise.

    named: options that tell jobs' results apart already.
    """
    job = HydraConfig.get()
    if job.mode != RunMode.MULTIRUN:
        return ""
    asked = [word for word in sys.argv[1:] if "=" in word and not word.startswith("-")]
    overrides = OverridesParser.create().parse_overrides(asked)
    telling = {o.key_or_group for o in overrides if o.is_sweep_override()} - set(named)
    own = (word for word in job.overrides.task if word.partition("=")[0].lstrip("+") in telling)
    return ",".join(sorted(own)).replace("/", "-")


def _one_line(function: Callable[P, None]) -> Callable[P, None]:
    """`function`, with expected errors turned into one line on stderr and an exit code."""

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        os.environ["HYDRA_FULL_ERROR"] = "1"  # or Hydra prints its own report and leaves with code 1
        try:
            function(*args, **kwargs)
        except (ExpertError, HydraException, OmegaConfBaseException) as error:
            cause = _cause(error)
            print(f"error: {' '.join(str(cause).split())}", file=sys.stderr)
            sys.exit(FAILED if _is_failure(cause) else BAD_INPUT)
        except KeyboardInterrupt:
            sys.exit(INTERRUPTED)

    return run


def _cause(error: BaseException) -> BaseException:
    """The first error of ours in a chain; Hydra wraps what a constructor raises."""
    link: BaseException | None = error
    while link is not None:
        if isinstance(link, ExpertError):
            return link
        link = link.__cause__
    return error


def _is_failure(error: BaseException) -> bool:
    return isinstance(error, ExpertError) and not isinstance(error, InvalidProblem)
