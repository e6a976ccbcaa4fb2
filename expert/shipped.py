"""What comes along with the code: configurations, problem files, `train.py` and `evaluate.py`.

In the repository they stand at its root; a wheel holds them in the folder `certmanip` (setup.py).
"""

import difflib
import os
from pathlib import Path

from expert.errors import InvalidProblem

_ROOT = Path(__file__).resolve().parent.parent
HOME = next((place for place in (_ROOT / "certmanip", _ROOT) if (place / "configs").is_dir()), _ROOT)
"""Folder with `configs`, `train.py` and `evaluate.py`."""
CONFIGS = HOME / "configs"
PREFIX = "shipped:"


def problem_names() -> list[str]:
    """Of the problem files that come along: `cage/t_4`."""
    folder = CONFIGS / "problem"
    return sorted(path.relative_to(folder).with_suffix("").as_posix() for path in folder.rglob("*.yaml"))


def located(name: str | os.PathLike[str]) -> Path:
    """A file by its name, or, as `shipped:cage/t_4`, a problem file that comes along.  Raises InvalidProblem for an unknown one."""
    if not (text := os.fspath(name)).startswith(PREFIX):
        return Path(name)
    asked, known = text.removeprefix(PREFIX), problem_names()
    if asked not in known:
        near = difflib.get_close_matches(asked, known, n=1)
        raise InvalidProblem(
            "file",
            expected=f"{PREFIX} and one of {len(known)} names, such as {', '.join(known[:1])}",
            got=text,
            remedy=f"did you mean {PREFIX}{near[0]}?" if near else "",
        )
    return CONFIGS / "problem" / f"{asked}.yaml"
