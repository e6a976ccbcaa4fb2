"""Every example runs as its first lines say, prints what it promises, and leaves what it names."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLES = sorted(path.name for path in (ROOT / "examples").glob("*.py"))
SLOW = pytest.mark.slow
RUNS = [
    pytest.param(
        "plan_and_check_a_push.py", "push.png", [], ["optimal", "the checker says: sound"]
    ),
    pytest.param("find_a_cage.py", "cage.png", [], ["caged", "the verifier says: caged"], marks=SLOW),
    pytest.param("check_somebodys_cage.py", "way_out.gif", [], ["four fingers: caged", "three of them: escapes"]),
    pytest.param("certified_grasp.py", "grasp.png", [], ["every start in Q0 ends at the goal", "100 of 100 executions"], marks=SLOW),
    pytest.param("plan_from_a_video.py", "clip", [], ["planned", r"ends 0\.\d+ mm and 0\.\d+ deg"], marks=SLOW),
    pytest.param("train_a_stage.py", "trained", ["--iterations", "3"], ["after 3 iterations", "trained: object-trajectory loss"], marks=SLOW),
    pytest.param("figures.py", "pictures", ["3-6", "5-16"], ["Fig. 3-6", "objective", "caged"], marks=SLOW),
    pytest.param("grasp_figures.py", "starts.png", ["5-30"], [r"t: certified by goal_cell", "hourglass_miqp2: "], marks=SLOW),
    pytest.param("against_force_closure.py", "ends.png", [], ["certified by goal_cell", "force closure: median error"], marks=SLOW),
    pytest.param("push_a_box.py", "box.png", [], ["solved after", "the checker says: sound"]),
    pytest.param("push_t.py", "push_t.gif", [], [r"success after \d+ steps, 9\d\.\d% covered"]),
    pytest.param("table_4_1.py", "table", ["--small"], [r"\| DLM \|", "report: "], marks=SLOW),
]  # fmt: skip
"""Script, its output, further arguments, and patterns that it prints."""


def test_every_example_is_run() -> None:
    assert sorted({str(run.values[0]) for run in RUNS}) == EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_short_and_says_how_to_run_it(name: str) -> None:
    text = (ROOT / "examples" / name).read_text()
    assert len(text.splitlines()) <= 60
    assert re.search(
        rf"^python examples/{name} -o \w|^python examples/{name} .* -o \w", text, flags=re.MULTILINE
    )


@pytest.mark.parametrize(("name", "output", "arguments", "printed"), RUNS)
def test_an_example_does_what_it_says(
    name: str, output: str, arguments: list[str], printed: list[str], tmp_path: Path
) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(ROOT / "examples" / name), *arguments, "-o", output]
    answer = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert answer.returncode == 0, answer.stderr
    for pattern in printed:
        assert re.search(pattern, answer.stdout), answer.stdout
    result = tmp_path / output
    pictures = [result] if result.suffix else [p for p in result.rglob("*") if p.suffix in (".png", ".gif")]
    assert pictures or name == "train_a_stage.py"
    for picture in pictures:
        shown(picture)


def shown(picture: Path) -> None:
    """A picture that is not blank; an animation that moves."""
    with Image.open(picture) as image:
        frames = [np.asarray(frame.convert("L"), dtype=float) for frame in ImageSequence.Iterator(image)]
    assert frames[0].std() > 1
    if picture.suffix == ".gif":
        assert len(frames) > 1
        assert any(np.abs(frame - frames[0]).max() > 10 for frame in frames[1:])
