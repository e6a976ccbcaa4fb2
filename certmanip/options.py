"""The options of a command, read from its configuration file and the comments in it: stated there, once."""

import re
from dataclasses import dataclass

from expert.shipped import CONFIGS

LINE = re.compile(r"^(?P<indent> *)(?:- )?(?P<name>[\w@]+):(?: +(?P<value>[^#]*?))? *(?:# *(?P<about>.*))?$")


@dataclass(frozen=True)
class Option:
    """An option of a command: its default as the file writes it, and what it means."""

    name: str
    default: str
    about: str


def options_of(config: str) -> list[Option]:
    """Options of configs/<config>.yaml in their order, those of a section as section.name, groups with their choices."""
    section, found = "", []
    for line in (CONFIGS / f"{config}.yaml").read_text(encoding="utf-8").splitlines():
        part = LINE.match(line)
        if part is None:
            continue
        name, value, about = part["name"], part["value"] or "", part["about"] or ""
        if not part["indent"]:
            section = "" if value else name
        if section == "defaults" and part["indent"]:
            found.append(Option(name, value, "; ".join(filter(None, [about, _choices(name)]))))
        elif section not in ("defaults", "hydra") and value and name != "_target_":
            found.append(Option(f"{section}.{name}" if section else name, value, about))
    return found


def _choices(group: str) -> str:
    """Of a group: the files in its folder."""
    folder = CONFIGS / group.partition("@")[0]
    names = (path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.yaml"))
    return "one of " + ", ".join(sorted(name for name in names if name != "common"))
