"""What pyproject.toml cannot say: a wheel holds configs/, train.py and evaluate.py too, in the folder of `certmanip`."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
ALONG = ["train.py", "evaluate.py", *(str(p.relative_to(ROOT)) for p in (ROOT / "configs").rglob("*.yaml"))]


class BuildWithCommands(build_py):
    """Copies what an installed command looks for (expert/shipped.py)."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            for name in ALONG:
                target = Path(self.build_lib, "certmanip", name)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / name, target)

    def get_source_files(self) -> list[str]:
        """For source distributions."""
        return [*super().get_source_files(), *ALONG]


setup(cmdclass={"build_py": BuildWithCommands})
