"""The commands as a user runs them: data by the expert, five stages, a kill, tables and report; then everything that can be wrong."""

import csv
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import torch
from hydra.utils import instantiate
from omegaconf import DictConfig
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import evaluate
import train
from datasets.store import read_manifest, write_manifest
from dlm.training.checkpoint import load, read_about

ROOT = Path(__file__).resolve().parent.parent
STAGES = ["nn", "nnm", "mdr", "cvx", "dlm"]
QUICK = ["experiment=smoke", "schedule.iterations=2", "schedule.log_every=1"]
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")


def start(script: str, *arguments: str, cwd: Path) -> subprocess.Popen[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, str(ROOT / script), *arguments],
        cwd=cwd,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        # A shell's background jobs, and their children, ignore Ctrl-C.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.default_int_handler),
    )


def finish(process: subprocess.Popen[str]) -> str:
    """Output of a command that must succeed without a word on stderr."""
    output, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    return output


@pytest.fixture(scope="module")
def workplace(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with data/smoke-seed0 and five trained stages under runs/smoke."""
    folder = tmp_path_factory.mktemp("work")
    (folder / "data").symlink_to(data_folder / "data")
    output = finish(start("train.py", "stage=all", *QUICK, cwd=folder))
    assert "next: python evaluate.py output=runs/smoke" in output
    return folder


@pytest.fixture(scope="module")
def results(workplace: Path) -> Path:
    """runs/smoke with tables and report."""
    output = finish(start("evaluate.py", "experiment=smoke", "examples=1", cwd=workplace))
    assert output.rstrip().endswith(f"report: {workplace / 'runs' / 'smoke' / 'report.html'}")
    return workplace / "runs" / "smoke"


def test_every_stage_leaves_a_checkpoint_that_says_what_made_it(workplace: Path) -> None:
    for stage in STAGES:
        about = read_about(workplace / "runs" / "smoke" / "seed_0" / f"{stage}.safetensors", command="")
        assert (about.stage, about.model, about.iteration) == (stage, "thesis", 2)
        assert about.data == read_manifest(workplace / "data" / "smoke-seed0")["sha256"]
        assert [row["iteration"] for row in about.history] == [1, 2]


@pytest.mark.parametrize("stage", STAGES)
def test_tensorboard_shows_curves_and_scenes(workplace: Path, stage: str) -> None:
    events = EventAccumulator(str(workplace / "runs" / "smoke" / "seed_0" / "tensorboard" / stage))
    events.Reload()
    names = {f"{kind}/{d}" for kind in ("object", "finger") for d in ("train", "finetune", "test", "family")}
    assert set(events.Tags()["scalars"]) == {"loss", *names}
    assert [event.step for event in events.Scalars("object/test")] == [1, 2]
    about = read_about(workplace / "runs" / "smoke" / "seed_0" / f"{stage}.safetensors", command="")
    logged = [event.value for event in events.Scalars("loss")]
    assert logged == pytest.approx([row["loss"] for row in about.history], rel=1e-6)
    assert events.Tags()["images"] == ["scene"]


def test_the_table_has_all_rows_and_columns(results: Path) -> None:
    lines = json.loads((results / "table_4_1.json").read_text())["lines"]
    models = ["no action", "NN", "NNM", "MDR", "CVX", "DLM", "MIQP (oracle)"]
    assert [line["model"] for line in lines] == models
    for line in lines:
        assert list(line["cells"]) == ["train", "finetune", "test", "family"]
        assert (line["forward"] is None) == (line["model"] == "no action")
        assert (line["backward"] is None) == (line["model"] in ("no action", "MIQP (oracle)"))
    idle, oracle = lines[0]["cells"]["train"], lines[-1]["cells"]["train"]
    assert idle["ratio"] == 1
    assert idle["within"] == 0
    assert oracle["within"] == 1
    assert oracle["loss"] < 1e-2 * idle["loss"]
    assert oracle["finger_loss"] == 0


def test_markdown_and_csv_say_the_same_as_json(results: Path) -> None:
    lines = json.loads((results / "table_4_1.json").read_text())["lines"]
    records = list(csv.DictReader((results / "table_4_1.csv").read_text().splitlines()))
    assert len(records) == 7 * 4
    for line in lines:
        for dataset, cell in line["cells"].items():
            record = next(r for r in records if (r["model"], r["dataset"]) == (line["model"], dataset))
            assert float(record["loss"]) == cell["loss"]
            assert int(record["dropped"]) == sum(map(len, cell["dropped"]))
    rows = [row for row in (results / "table_4_1.md").read_text().splitlines() if row.startswith("| DLM |")]
    shown = re.findall(r"[\d.e+-]+", rows[0])
    assert float(shown[0]) == pytest.approx(lines[5]["cells"]["train"]["loss"], abs=5e-4)


def test_the_report_needs_no_network(results: Path) -> None:
    page = (results / "report.html").read_text()
    outside = re.findall(r'(?:src|href)="(?!data:|#)[^"]*"|url\((?!data:)|@import', page)
    assert outside == []
    assert page.count("<animate ") > 10


def browse(page: Path, profile: Path, *, width: int = 1200) -> str:
    """The page as Chromium has it once scripts have run; it must not complain."""
    answer = subprocess.run(
        [
            str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
            "--enable-logging=stderr", "--virtual-time-budget=2000", f"--window-size={width},900", "--dump-dom",
            f"file://{page}",
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert "CONSOLE" not in answer.stderr
    return answer.stdout


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the report in")
def test_the_report_opens_in_a_browser(results: Path, tmp_path: Path) -> None:
    seen = browse(results / "report.html", tmp_path)
    models = 6
    assert seen.count("<svg ") == 2 * models  # an example of the family and one of the test set
    assert seen.count("<img ") == 2 + 2 * 2  # curves, whole motions; video and strip of each example
    assert (
        seen.count("<table") == 1 + 7 + 1 + 4 + 1
    )  # Table 4.1, its details, order, tests by data set, origin
    assert seen.rstrip().endswith("</html>")


MEASURE = """<script>
const wide = [...document.querySelectorAll(".scroll")].filter(x => x.scrollWidth > x.clientWidth).length;
const page = document.documentElement;
document.title = `${wide} tables, page ${page.scrollWidth - page.clientWidth}`;
</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium to open the report in")
@pytest.mark.parametrize("width", [1200, 500])
def test_the_report_fits_desks_and_telephones(results: Path, tmp_path: Path, width: int) -> None:
    """On a desk no table is cut off; on a telephone tables scroll by themselves, never the page."""
    page = tmp_path / "report.html"
    page.write_text((results / "report.html").read_text().replace("</body>", MEASURE + "</body>"))
    found = re.search(
        r"<title>(\d+) tables, page (-?\d+)</title>", browse(page, tmp_path / "profile", width=width)
    )
    assert found is not None
    assert int(found[2]) == 0
    assert int(found[1]) == 0 or width < 1200


@pytest.mark.slow
def test_the_command_that_training_names_judges_the_structured_model_too(workplace: Path) -> None:
    """Six seconds of training on four tasks as they are, without variations, and the first guess plans them all."""
    model = ["experiment=smoke", "model=structured", "stage=structured/mdr", "output=runs/structured"]
    schedule = {
        "iterations": 200,
        "learning_rate": 2e-4,
        "batch_size": 4,
        "log_every": 200,
        "save_every": 200,
    }
    model += ["stages.mdr.loss.splitting=false", "stages.mdr.loss.mirroring=false"]
    said = finish(
        start("train.py", *model, *(f"schedule.{k}={v}" for k, v in schedule.items()), cwd=workplace)
    )
    (following,) = re.findall(r"^next: python (.*)$", said, re.MULTILINE)
    finish(start(*following.split(), "examples=1", cwd=workplace))
    lines = json.loads((workplace / "runs" / "structured" / "table_4_1.json").read_text())["lines"]
    assert [line["model"] for line in lines] == ["no action", "MDR", "MIQP (oracle)"]
    learned = lines[1]["cells"]["train"]
    assert learned["unsolved"] == [[]]
    assert learned["ratio"] < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "stage", "seeds"), [("thesis", "mdr", (3, 4)), ("structured", "structured/mdr", (3,))]
)
def test_the_same_seeds_give_the_same_weights_side_by_side_and_after_a_kill(
    workplace: Path, model: str, stage: str, seeds: tuple[int, ...]
) -> None:
    """One seed after the other, undisturbed; and a process for each, killed at a random moment and gone on with."""
    side_by_side = f"jobs={len(seeds)}"
    schedule = ["schedule.iterations=30", "schedule.log_every=10", "schedule.save_every=1"]
    command = [f"model={model}", f"stage={stage}", "experiment=smoke", f"seeds=[{','.join(map(str, seeds))}]"]
    command += schedule
    whole = start("train.py", *command, f"output=whole/{model}", cwd=workplace)
    killed = start("train.py", *command, f"output=killed/{model}", side_by_side, cwd=workplace)
    kill_after_first_checkpoint(killed, workplace / "killed" / model, moment=random.random())
    finish(whole)
    finish(start("train.py", *command, f"output=killed/{model}", side_by_side, "resume=true", cwd=workplace))
    for seed in seeds:
        a, b = (
            load(workplace / name / model / f"seed_{seed}" / "mdr.safetensors", command="")
            for name in ("whole", "killed")
        )
        assert len(a.about.history) == 4  # after iterations 1, 10, 20, 30
        assert b.about.history == a.about.history
        assert all(torch.equal(a.model[k], b.model[k]) for k in a.model)


def kill_after_first_checkpoint(process: subprocess.Popen[str], folder: Path, *, moment: float) -> None:
    """Kill the command and its workers without warning, `moment` seconds after there is a first checkpoint."""
    deadline = time.monotonic() + 200
    while not list(folder.glob("*/*.safetensors")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(moment)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL, (
        f"it ended before the kill, {moment} s after the first checkpoint"
    )
    for path in folder.glob("*/*.safetensors"):
        load(path, command="")  # whole, whatever the moment


def test_an_interrupt_ends_with_one_line_that_says_how_to_go_on(workplace: Path) -> None:
    process = start(
        "train.py", "stage=mdr", "experiment=smoke", "output=stopped", "schedule.save_every=1", cwd=workplace
    )
    path = workplace / "stopped" / "seed_0" / "mdr.safetensors"
    deadline = time.monotonic() + 120
    while not path.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.count("\n") == 1
    assert "interrupted" in errors
    assert "resume=true" in errors
    assert load(path, command="").about.stage == "mdr"


@pytest.fixture
def ask(
    workplace: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[object, str]]:
    """Run train or evaluate here, with arguments; the exit code and what it says on stderr."""
    monkeypatch.chdir(workplace)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")

    def run(main: Callable[[], None], *arguments: str) -> tuple[object, str]:
        monkeypatch.setattr(sys, "argv", ["command.py", *arguments])
        with pytest.raises(SystemExit) as exit_:
            main()
        return exit_.value.code, capsys.readouterr().err

    return run


def mistake(folder: Path, name: str) -> None:
    """Prepare `folder/bad`, a copy of the results of training, with one thing wrong."""
    source, bad = folder / "runs" / "smoke" / "seed_0", folder / "bad" / "seed_0"
    shutil.rmtree(folder / "bad", ignore_errors=True)
    shutil.copytree(source, bad, ignore=shutil.ignore_patterns("tensorboard"))
    if name == "another model":
        shutil.copy(source / "nn.safetensors", bad / "mdr.safetensors")
    elif name == "truncated":
        whole = (bad / "cvx.safetensors").read_bytes()
        (bad / "cvx.safetensors").write_bytes(whole[: len(whole) // 2])
    elif name == "missing":
        (bad / "mdr.safetensors").unlink()
    elif name == "empty data":
        empty = folder / "empty"
        write_manifest(empty, {**read_manifest(folder / "data" / "smoke-seed0"), "shards": [], "tasks": 0})


TRAIN, EVALUATE = train.main, evaluate.main
SMOKE, BAD = "experiment=smoke", "output=bad"

WRONG: dict[str, tuple[Callable[[], None], list[str], str]] = {
    "unknown stage": (TRAIN, [SMOKE, "stage=dml"], r"stage/dml.*all cvx dlm mdr nn nnm"),
    "unknown model": (TRAIN, [SMOKE, "model=bigger"], r"model/bigger.*thesis"),
    "unknown option": (TRAIN, [SMOKE, "iterations=5"], r"iterations"),
    "unknown torque": (TRAIN, [SMOKE, "solver.torque=exact"], r"torque: expected first_order or thesis, got exact"),
    "too few tasks": (TRAIN, [SMOKE, "train_tasks=5"], r"train_tasks: expected a whole number from 2 to 4, got 5"),
    "no iterations": (TRAIN, [SMOKE, "schedule.iterations=0"], r"iterations: expected a whole number from 1 on, got 0"),
    "negative kappa": (TRAIN, [SMOKE, "simulator.kappa=-1"], r"kappa: expected a positive number"),
    "missing data": (TRAIN, ["stage=nn", BAD], r"data/train-seed0.*python -m datasets\.generate"),
    "empty data": (TRAIN, [SMOKE, "stage=nn", "data.train=empty", BAD], r"at least one shard"),
    "missing": (TRAIN, [SMOKE, "stage=cvx", BAD], r"mdr\.safetensors.*python train\.py stage=mdr model=thesis seed=0"),
    "truncated": (TRAIN, [SMOKE, "stage=dlm", BAD], r"cvx\.safetensors: expected a whole checkpoint"),
    "another model": (TRAIN, [SMOKE, "stage=cvx", BAD], r"mdr\.safetensors: expected"),
    "other settings": (TRAIN, [SMOKE, "stage=nn", BAD, "resume=true", "schedule.learning_rate=1e-3"], r"learning_rate"),
    "nothing trained": (EVALUATE, [SMOKE, "output=nowhere"], r"nowhere/seed_0/nn\.safetensors.*python train\.py stage=nn"),
    "seeds of letters": (TRAIN, [SMOKE, "seeds=abc"], r"seed: expected a whole number from 0 to"),
    "half a thread": (TRAIN, [SMOKE, "threads=0.5"], r"threads: expected a whole number from 1 to 1024, got 0\.5"),
    "films of letters": (EVALUATE, [SMOKE, "examples=all"], r"examples: expected a whole number from 0 on, got all"),
    "no stages": (EVALUATE, [SMOKE, "stages=[]"], r"stages: expected at least one of stages"),
    "no tasks": (EVALUATE, [SMOKE, "tasks=1"], r"tasks: expected a number of at least 2, got 1"),
    "no seeds": (EVALUATE, [SMOKE, "seeds=[]"], r"seeds: expected at least one of seeds"),
    "one stage another": (EVALUATE, [SMOKE, BAD], r"mdr\.safetensors: expected stage mdr, got stage nn"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_gets_one_line_and_code_2_and_destroys_nothing(
    name: str, workplace: Path, ask: Callable[..., tuple[object, str]]
) -> None:
    mistake(workplace, "another model" if name == "one stage another" else name)
    files = {p: p.read_bytes() for p in (workplace / "bad").rglob("*") if p.is_file()}
    command, arguments, words = WRONG[name]
    code, said = ask(command, *arguments)
    assert code == 2
    assert re.fullmatch(r"error: [^\n]+\n", said)
    assert re.search(words, said)
    assert {p: p.read_bytes() for p in (workplace / "bad").rglob("*") if p.is_file()} == files


def groups() -> list[tuple[str, str]]:
    """Every option of every configuration group, with a command that takes it."""
    owner = {"dataset": ("generate", "dataset"), "shapes": ("generate", "shapes@dataset.shapes")}
    return [
        (command, f"{option}={path.stem}")
        for path in sorted((ROOT / "configs").glob("*/*.yaml"))
        if path.stem != "common"
        for command, option in [owner.get(path.parent.name, ("train", path.parent.name))]
    ]


@pytest.mark.parametrize(
    ("command", "choice"), [*groups(), ("train", ""), ("evaluate", ""), ("generate", ""), ("evaluate", "data=smoke"),
     ("evaluate", "experiment=table_4_1"), ("infer", "video=clip.mp4")]
)  # fmt: skip
def test_every_configuration_composes_without_gaps(
    command: str, choice: str, composed: Callable[..., DictConfig]
) -> None:
    from omegaconf import OmegaConf

    configuration = composed(command, *[choice] if choice else [])
    plain = OmegaConf.to_container(configuration, resolve=True, throw_on_missing=True)
    assert {"seed", "seeds", "video"} & set(plain)


def test_the_large_comparison_has_every_stage_and_a_control_that_differs_from_dlm_in_its_loss_alone(
    composed: Callable[..., DictConfig],
) -> None:
    cfg = composed("train", "experiment=table_4_1_large")
    stages = {name: instantiate(stage, _convert_="object") for name, stage in cfg.stages.items()}
    assert list(stages) == ["mdr", "cvx", "dlm", "cvx_longer", "nn", "nnm"]
    assert all(stage.name == name for name, stage in stages.items())
    common = instantiate(cfg.schedule)
    dlm, control = stages["dlm"], stages["cvx_longer"]
    assert (dlm.dataset, dlm.warm_start) == (control.dataset, control.warm_start) == ("finetune", "cvx")
    assert dlm.scheduled(common) == control.scheduled(common)
    assert control.loss == stages["cvx"].loss
    assert {stage.scheduled(common).decay for stage in stages.values()} == {"cosine"}
    assert cfg.model.sizes.dropout == 0


@pytest.mark.parametrize("stage", ["mdr", "cvx", "dlm", "nn", "nnm"])
def test_every_stage_of_the_neural_model_fits_its_policies(
    composed: Callable[..., DictConfig], stage: str
) -> None:
    cfg = composed("train", "experiment=neural")
    built = instantiate(cfg.stages[stage], _convert_="object")
    policy = instantiate(cfg.model, _convert_="object").build(built.policy, seed=0)
    assert policy.weights()
    assert built.warm_start is None or built.warm_start in cfg.stages
