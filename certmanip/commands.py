"""The commands: what each is for, which program does it, and how its words go on to it."""

import difflib
from collections.abc import Collection
from dataclasses import dataclass
from typing import NoReturn

from expert.errors import InvalidProblem

USUAL = {0: "done", 1: "failed", 2: "bad input", 130: "interrupted"}


@dataclass(frozen=True, kw_only=True)
class Command:
    """program: module or script.  config: file of its options, configs/<config>.yaml; empty: those of `expert`.

    first: option that a first word without a name stands for.  output: option that -o stands for.  codes: exit codes beside
    the usual ones.
    """

    purpose: str
    program: str
    example: str
    config: str = ""
    first: str = ""
    output: str = ""
    codes: tuple[tuple[int, str], ...] = ()


COMMANDS = {
    "solve": Command(
        purpose="find a contact plan, a cage or a certified grasp for a problem file",
        program="expert",
        example="certmanip solve shipped:cage/t_4 -o cage.json",
    ),
    "verify": Command(
        purpose="check a solution file, or given fingers, without solving anything",
        program="expert",
        example="certmanip verify cage.json -o certificate.json",
    ),
    "draw": Command(
        purpose="picture or animation of a solution file",
        program="expert",
        example="certmanip draw cage.json -o cage.png",
    ),
    "infer": Command(
        purpose="plan where two fingers touch the object of a video, and with what forces, to move it as the video shows",
        program="dlm.infer",
        config="infer",
        first="video",
        output="out",
        example="certmanip infer clip.mp4 --scale 0.001 -o clip",
        codes=((4, "no plan found"),),
    ),
    "generate": Command(
        purpose="make a data set: random objects and motions, their videos, and the expert's actions",
        program="datasets.generate",
        config="generate",
        first="dataset",
        output="out",
        example="certmanip generate smoke --seed 0 --jobs 2",
    ),
    "train": Command(
        purpose="train the architectures of Table 4.1, or the structured model, on data sets",
        program="train.py",
        config="train",
        output="output",
        example="certmanip train --stage all --experiment smoke --schedule.iterations 2",
    ),
    "evaluate": Command(
        purpose="compare trained architectures: Table 4.1, figures 4-6 and 4-7, a report",
        program="evaluate.py",
        config="evaluate",
        output="results",
        example="certmanip evaluate --experiment smoke --seeds [0] --examples 1",
    ),
    "control": Command(
        purpose="push an object to its goal in closed loop, from state or from pixels: Push-T",
        program="dlm.control",
        config="control",
        output="out",
        example="certmanip control --world pusht --observation pixels --episodes 3 -o push_t",
    ),
}


def unknown(what: str, name: str, known: Collection[str]) -> NoReturn:
    """Raise InvalidProblem for a word that is none of the known ones."""
    near = difflib.get_close_matches(name, known, n=1)
    remedy = f"did you mean {near[0]}?" if near else "see --help"
    raise InvalidProblem(what, expected=f"one of {', '.join(known)}", got=name, remedy=remedy)
