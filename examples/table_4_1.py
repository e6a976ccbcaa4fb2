"""Table 4.1, Fig. 4-6 and Fig. 4-7 of the thesis: data, five architectures, and the report that compares them.

python examples/table_4_1.py -o table            (five seeds, some 25 minutes)
python examples/table_4_1.py -o table --small    (four tasks, two iterations: shows that it runs, not how well)
"""

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument(
    "-o", "--output", type=Path, default=Path("runs/table_4_1"), help="weights, tables and figures"
)
parser.add_argument("--small", action="store_true")
options = parser.parse_args()

names = ["smoke"] if options.small else ["train", "finetune", "test", "family"]
experiment = "smoke" if options.small else "table_4_1"
training = ["schedule.iterations=2"] if options.small else []
judging = ["seeds=[0]", "examples=1"] if options.small else []

output = f"output={options.output.resolve()}"
for command in (
    *(["-m", "datasets.generate", f"dataset={name}"] for name in names),
    [str(ROOT / "train.py"), f"experiment={experiment}", output, *training],
    [str(ROOT / "evaluate.py"), f"experiment={experiment}", output, *judging],
):
    print("==", *command, flush=True)
    subprocess.run([sys.executable, *command], check=True)
