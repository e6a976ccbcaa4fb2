"""What is missing, or in the way, is said in one line with its remedy."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from certmanip.installation import EXTRAS, IncompleteInstallation, explained, require_own_datasets

ROOT = Path(__file__).resolve().parents[2]


def test_extras_are_those_of_the_package() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    extras = {*re.findall(r"^(\w+) = \[", text[text.index("[project.optional") :], flags=re.MULTILINE)}
    assert EXTRAS.keys() <= extras


@pytest.mark.parametrize(
    ("module", "extra"), [("torch.nn", "learn"), ("cv2", "learn"), ("ezdxf", "outlines")]
)
def test_a_missing_extra_is_named_with_the_command(module: str, extra: str) -> None:
    words = rf"^{module.partition('.')[0]}: .* pip install 'certified-manipulation\[{extra}\]'$"
    with pytest.raises(IncompleteInstallation, match=words), explained():
        raise ModuleNotFoundError("not here", name=module)


def test_other_missing_modules_are_not_explained_away() -> None:
    with pytest.raises(ModuleNotFoundError, match="own bug"), explained():
        raise ModuleNotFoundError("own bug", name="expert.nowhere")


def test_this_installation_has_its_own_datasets() -> None:
    require_own_datasets()


def other_datasets(folder: Path) -> Path:
    """A package of that name, as somebody else's."""
    (folder / "datasets").mkdir(parents=True)
    (folder / "datasets" / "__init__.py").write_text("def load_dataset(): ...\n")
    return folder


def test_another_datasets_that_is_found_first_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "datasets")
    monkeypatch.syspath_prepend(other_datasets(tmp_path))
    with pytest.raises(IncompleteInstallation, match=f"got another, in {tmp_path / 'datasets'}; install"):
        require_own_datasets()


def test_another_datasets_in_the_same_folder_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    about = tmp_path / "datasets-4.0.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: datasets\nVersion: 4.0.0\n")
    other_datasets(tmp_path)
    monkeypatch.delitem(sys.modules, "datasets")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("certmanip.installation.PACKAGES", tmp_path)
    with pytest.raises(IncompleteInstallation, match=r"Hugging Face's datasets 4\.0\.0 in the same folder"):
        require_own_datasets()


def test_a_command_ends_with_that_line(tmp_path: Path) -> None:
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); from certmanip.__main__ import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", code, str(other_datasets(tmp_path)), "generate", "smoke"],
        cwd=ROOT, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert re.fullmatch(
        r"error: datasets: expected certified-manipulation's, .* got another, .*\n", done.stderr
    )
