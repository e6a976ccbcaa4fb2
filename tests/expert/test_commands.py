"""`python -m expert`, run as a user runs it: exit codes, one-line errors, files that appear or stay as they were."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

PROBLEMS = Path("configs/problem/contact_trajectory").absolute()
SLIDE = PROBLEMS / "block_slide_one_finger.yaml"


def expert(*arguments: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "expert", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def error_line(done: subprocess.CompletedProcess[str]) -> str:
    """The only line on stderr of a command that refused its input."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    return line


@pytest.fixture(scope="module")
def solution(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The solved slide."""
    path = tmp_path_factory.mktemp("solved") / "slide.json"
    done = expert("solve", SLIDE, "-o", path)
    assert done.returncode == 0, done.stderr
    assert f"next: python -m expert verify {path}" in done.stdout
    return path


def altered(solution: Path, folder: Path, **changes: Any) -> Path:
    path = folder / "altered.json"
    path.write_text(json.dumps({**json.loads(solution.read_text()), **changes}))
    return path


def test_a_solution_is_sound_and_its_certificate_says_so(solution: Path, tmp_path: Path) -> None:
    done = expert("verify", solution, "-o", tmp_path / "certificate.json")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("sound: optimal")
    certificate = json.loads((tmp_path / "certificate.json").read_text())
    assert certificate["verdict"] == "sound"
    assert len(certificate["checks"]) > 15
    assert all(check["ok"] for check in certificate["checks"])
    unchecked = [line for line in done.stdout.splitlines() if line.startswith("claimed, not checked: ")]
    assert unchecked == ["claimed, not checked: " + ", ".join(certificate["claimed"])]
    assert "seconds" in certificate["claimed"]


def test_a_solution_carries_its_whole_problem(solution: Path) -> None:
    data = json.loads(solution.read_text())
    assert list(data)[:4] == ["schema", "solution", "problem", "status"]
    assert data["problem"]["description"] == "one finger slides a block along the floor"
    assert data["objective"] == pytest.approx(0.0604814, rel=1e-3)


def test_tampering_is_refuted_with_exit_1(solution: Path, tmp_path: Path) -> None:
    done = expert("verify", altered(solution, tmp_path, objective=0.01))
    assert done.returncode == 1
    assert "REFUTED objective" in done.stdout


def test_an_answer_without_a_plan_is_unknown_with_exit_4(solution: Path, tmp_path: Path) -> None:
    done = expert("verify", altered(solution, tmp_path, status="time_limit"))
    assert done.returncode == 4
    assert done.stdout.startswith("unknown")


def test_summary_is_one_json_line() -> None:
    done = expert("solve", SLIDE, "--summary")
    assert done.returncode == 0
    (line,) = done.stdout.splitlines()
    summary = json.loads(line)
    assert list(summary) == ["status", "objective", "bound", "gap", "seconds"]
    assert (summary["status"], done.stderr) == ("optimal", "")
    assert summary["gap"] <= 1e-3


def test_proven_infeasibility_exits_3_and_is_checked_without_the_solver(tmp_path: Path) -> None:
    path = tmp_path / "s.json"
    done = expert("solve", PROBLEMS / "block_lift_one_finger_infeasible.yaml", "-o", path)
    assert done.returncode == 3
    assert "step 0" in done.stdout
    assert json.loads(path.read_text())["objective"] is None
    assert expert("verify", path).returncode == 0


def test_a_limit_exits_4_and_claims_no_optimum(tmp_path: Path) -> None:
    hard = PROBLEMS / "transverse_rotation_two_fingers.yaml"
    limited = tmp_path / "limited.yaml"
    limited.write_text(hard.read_text().replace("gap: 0.001,", "gap: 0.0, node_limit: 3,"))
    done = expert("solve", limited, "--summary")
    assert done.returncode == 4, done.stderr
    summary = json.loads(done.stdout)
    assert summary["status"] in ("feasible", "time_limit")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass: 0.01", "mass: -0.01", "object.mass"),
        ("count: 1", "cuont: 1", "did you mean count"),
        ("dt: 0.1", "dt: .nan", "trajectory.dt"),
        ("schema: 1", "schema: [1", "line 3"),
    ],
)
def test_bad_files_exit_2_with_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    path, output = tmp_path / "bad.yaml", tmp_path / "s.json"
    text = SLIDE.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    output.write_text("precious")
    line = error_line(expert("solve", path, "-o", output))
    assert message in line
    assert str(path) in line
    assert output.read_text() == "precious"


def test_bad_requests_exit_2_with_one_line(solution: Path, tmp_path: Path) -> None:
    assert "options.method" in error_line(expert("solve", SLIDE, "--method", "magic"))
    assert "output" in error_line(expert("solve", SLIDE, "-o", tmp_path / "absent" / "s.json"))
    assert "readable" in error_line(expert("verify", tmp_path / "absent.json"))
    assert "solve it first" in error_line(expert("verify", SLIDE))
    assert "solve it first" in error_line(expert("draw", SLIDE, "-o", tmp_path / "a.png"))
    assert ".gif" in error_line(expert("draw", solution, "-o", tmp_path / "a.bmp"))
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_command_line_exits_2() -> None:
    assert expert().returncode == 2
    assert expert("levitate", SLIDE).returncode == 2


def test_draw_writes_the_picture(solution: Path, tmp_path: Path) -> None:
    done = expert("draw", solution, "-o", tmp_path / "slide.png")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "slide.png").read_bytes().startswith(b"\x89PNG")


def heed_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_ctrl_c_ends_cleanly_and_leaves_files_alone(tmp_path: Path) -> None:
    endless, output = tmp_path / "endless.yaml", tmp_path / "s.json"
    text = (PROBLEMS / "transverse_wall_slide_pivot_two_fingers.yaml").read_text()
    endless.write_text(text.replace("gap: 0.001, time_limit: 60", "gap: 0.0, time_limit: 600"))
    output.write_text("precious")
    command = [sys.executable, "-m", "expert", "solve", str(endless), "-o", str(output)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # a shell's background jobs, and their children, ignore Ctrl-C
    with subprocess.Popen(command, **pipes, preexec_fn=heed_interrupts) as process:
        time.sleep(8)  # long enough to be at work, on a busy machine too
        assert process.poll() is None, process.communicate()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    assert "interrupted" in errors
    assert output.read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["endless.yaml", "s.json"]
