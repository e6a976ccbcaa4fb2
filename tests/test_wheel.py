"""A wheel, installed away from the repository, has all that its commands need."""

import os
import shutil
import site
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGED = ("expert", "datasets", "dlm", "certmanip", "configs")
FILES = ("setup.py", "pyproject.toml", "README.md", "LICENSE", "train.py", "evaluate.py")


def run(*words: object, cwd: Path) -> str:
    """Output of a command that must succeed, with nothing of the repository on its path."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run(
        [*map(str, words)], cwd=cwd, env={**clean, "OMP_NUM_THREADS": "1"},
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the executables of an environment that holds the wheel beside the libraries of this one."""
    folder = tmp_path_factory.mktemp("elsewhere")
    source = folder / "source"
    for name in PACKAGED:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in FILES:
        shutil.copy(ROOT / name, source / name)
    pip = (sys.executable, "-m", "pip")
    run(*pip, "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", folder, source, cwd=folder)
    run(sys.executable, "-m", "venv", "--without-pip", folder / "venv", cwd=folder)
    shutil.rmtree(source)
    scripts = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
    packages = sysconfig.get_path("purelib", vars={"base": str(folder / "venv")})
    # A plain path: the editable installation of this environment, which a .pth file of its own announces, stays unseen.
    Path(packages, "libraries.pth").write_text("\n".join(site.getsitepackages()))
    (wheel,) = folder.glob("*.whl")
    run(*pip, "--python", scripts / "python", "install", "--no-deps", "--no-index", wheel, cwd=folder)
    bring_compiled_code(Path(packages))
    return scripts


def bring_compiled_code(packages: Path) -> None:
    """Give files that are the same here what numba has compiled of them: compiling takes minutes and is not what is tested."""
    for source in (path for name in PACKAGED for path in (ROOT / name).rglob("*.py")):
        target = packages / source.relative_to(ROOT)
        assert target.read_bytes() == source.read_bytes()
        os.utime(target, ns=(source.stat().st_atime_ns, source.stat().st_mtime_ns))
        for compiled in (source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ic]"):
            target.with_name("__pycache__").mkdir(exist_ok=True)
            shutil.copy2(compiled, target.parent / "__pycache__" / compiled.name)


@pytest.mark.slow
def test_commands_run_away_from_the_repository(installed: Path, tmp_path: Path) -> None:
    where = run(installed / "python", "-c", "import expert; print(expert.__file__)", cwd=tmp_path)
    assert not Path(where.strip()).is_relative_to(ROOT)
    certmanip = installed / "certmanip"
    assert "status caged" in run(certmanip, "solve", "shipped:cage/t_4", "-o", "cage.json", cwd=tmp_path)
    assert run(certmanip, "verify", "cage.json", cwd=tmp_path).startswith("caged")
    run(certmanip, "draw", "cage.json", "-o", "cage.png", cwd=tmp_path)
    assert (tmp_path / "cage.png").stat().st_size > 1000
    for name in ("infer", "generate", "train", "evaluate", "control"):
        assert "exit codes" in run(certmanip, name, "--help", cwd=tmp_path)
    for name in ("generate", "train", "evaluate", "control"):
        assert run(certmanip, name, "--cfg", "job", cwd=tmp_path)  # composed from the wheel's configurations


@pytest.mark.slow
def test_a_data_set_is_made_away_from_the_repository(installed: Path, tmp_path: Path) -> None:
    words = ("smoke", "--seed", "0", "--jobs", "1", "--dataset.count", "1", "-o", "data")
    assert "data: 1 tasks" in run(installed / "certmanip", "generate", *words, cwd=tmp_path)
    assert (tmp_path / "data" / "manifest.json").is_file()


@pytest.mark.slow
def test_one_import_is_enough(installed: Path, tmp_path: Path) -> None:
    code = "import certmanip; print(certmanip.load('shipped:cage/i_given').verify().verdict, certmanip.__version__)"
    assert run(installed / "python", "-c", code, cwd=tmp_path).split()[0] == "caged"
