"""Help says what the configuration files say."""

from collections.abc import Callable

import pytest
from omegaconf import DictConfig, OmegaConf

from certmanip.commands import COMMANDS
from certmanip.help import help_page, overview
from certmanip.options import options_of

CONFIGURED = {name: command for name, command in COMMANDS.items() if command.config}


@pytest.mark.parametrize("name", CONFIGURED)
def test_every_option_is_listed(name: str, composed: Callable[..., DictConfig]) -> None:
    needed = ["video=clip.mp4"] if name == "infer" else []
    plain = OmegaConf.to_container(composed(CONFIGURED[name].config, *needed), resolve=False)
    assert isinstance(plain, dict)
    listed = {option.name.partition(".")[0].partition("@")[0] for option in options_of(name)}
    # What is not listed comes from a group's file: stages of `stage`, the simulator that watches.
    assert set(plain) - listed <= {"stages", "watch"}
    command = CONFIGURED[name]
    assert {command.output, command.first} - {""} <= listed


def test_defaults_units_and_choices() -> None:
    options = {option.name: option for option in options_of("train")}
    assert (options["schedule.iterations"].default, options["output"].default) == ("100", "runs")
    assert options["solver"].about == "one of batched, cvxpylayers"
    assert "schedule._target_" not in options
    assert {o.name: o.about for o in options_of("infer")}["mass"] == "of the object [kg]"


@pytest.mark.parametrize("name", CONFIGURED)
def test_help_has_purpose_options_example_and_exit_codes(name: str) -> None:
    page = help_page(name, CONFIGURED[name])
    assert page.startswith(f"usage: certmanip {name} ")
    assert f"example: certmanip {name} " in page
    assert "exit codes: 0 done, 1 failed, 2 bad input" in page
    assert max(map(len, page.splitlines())) <= 100
    assert all(f"--{o.name} " in page for o in options_of(name) if o.name != CONFIGURED[name].first)


def test_the_overview_lists_all_commands() -> None:
    assert all(f"\n  {name} " in overview() for name in COMMANDS)
