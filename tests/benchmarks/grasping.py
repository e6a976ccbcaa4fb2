"""Certified grasping: certificates of named and random objects, and their executions, with their bars.

    python -m tests.benchmarks.grasping [--quick] [--only PART ...] [--json FILE]

Parts and bars (seconds are processor time of one thread):
certificates   12 random polygons with 4-6 facets and 6 named objects at 15 deg all certified, checked once more here after
               a rigid motion; 10 of the 12 at 30 deg; median <= 5 s, max <= 30 s; dead-end check <= 2 s; starts at the
               goal's orientation at least 1 % of the object in the median, T 2.5 %, hourglass 10 %
executions     500 random starts of each certified object, and its hard ones: all end within 1e-5 of size and 0.01 deg
"""

import sys
import time

import numpy as np

from expert.geometry.polygon import mass_properties
from expert.verify.grasp.finger_path import FingerPath
from expert.verify.grasp.start_set import StartSet
from tests.benchmarks._grasp_study import Bars, Part, Row, Study, arrivals, moved_report, run, watched
from tests.support.experiments import hard_starts

MEDIAN_BAR, MAX_BAR, DEAD_END_BAR, WIDE_BAR = 5.0, 30.0, 2.0, 10 / 12
AREA_BARS = {"median": 0.01, "T": 0.025, "hourglass": 0.10}


def certificates(study: Study) -> tuple[list[Row], Bars]:
    """Every object at 15 deg, the random ones (quick: one of them) at 30 deg too."""
    wide = list(study.random)[2:3] if study.quick else study.random
    cases = [(name, 15.0) for name in study.objects] + [(name, 30.0) for name in wide]
    rows = [_certificate(study, name, degrees) for name, degrees in watched(cases, "certificates")]
    return rows, _certificate_bars(rows)


def _certificate(study: Study, name: str, degrees: float) -> Row:
    problem, answer = study.grasp(name, degrees)
    row: Row = {
        "object": name, "degrees": degrees, "status": answer.status, "method": answer.method,
        "refuted": answer.refuted, "seconds": study.seconds[name, degrees], "reason": answer.reason,
    }  # fmt: skip
    if len(answer.path):
        report = moved_report(problem, answer)
        row |= {"verdict": report.verdict, "dead_end_seconds": report.spent.get("dead_ends", np.nan)}
        row["dead_ends"] = report.dead_ends.verdict if report.dead_ends else None
        area = report.start.area if report.start else 0.0
        row["area"] = area / mass_properties(problem.shape.vertices).area
    return row


def _certificate_bars(rows: list[Row]) -> Bars:
    narrow = [r for r in rows if r["degrees"] == 15]
    wide = [r for r in rows if r["degrees"] == 30]
    sure = [r for r in rows if r["status"] == "certified" and r.get("verdict") == "certified"]
    seconds = [r["seconds"] for r in rows]
    areas = {r["object"]: r.get("area", 0.0) for r in narrow}
    return {
        "all certified at 15 deg": all(r in sure for r in narrow),
        "10 of 12 certified at 30 deg": sum(r in sure for r in wide) >= WIDE_BAR * len(wide),
        "no certificate is refuted after a motion": all(
            r["verdict"] != "refuted" for r in rows if r["status"] == "certified"
        ),
        f"median <= {MEDIAN_BAR:g} s": float(np.median(seconds)) <= MEDIAN_BAR,
        f"max <= {MAX_BAR:g} s": max(seconds) <= MAX_BAR,
        f"dead-end check <= {DEAD_END_BAR:g} s": max(r["dead_end_seconds"] for r in sure) <= DEAD_END_BAR,
        "median start area >= 1 %": float(np.median(list(areas.values()))) >= AREA_BARS["median"],
        "T >= 2.5 %": areas["T"] >= AREA_BARS["T"],
        "hourglass >= 10 %": areas["hourglass"] >= AREA_BARS["hourglass"],
    }


def executions(study: Study) -> tuple[list[Row], Bars]:
    """The sweeping process from random and hard starts of every certified grasp, at 15 and 30 deg."""
    count = 100 if study.quick else 500
    grasps = {key: pair for key, pair in study.found.items() if pair[1].found}
    if not grasps:
        grasps = {(name, 15.0): (problem, answer) for name, problem, answer in study.certified()}
    rows = []
    for (name, degrees), (problem, answer) in watched(grasps.items(), "executions"):
        path = FingerPath(problem.shape, problem.pose, answer.path)
        starts, rng = StartSet(path), np.random.default_rng(0)
        random, hard = starts.starts(rng, count), hard_starts(path, starts, rng)
        began = time.process_time()
        runs = arrivals(problem, answer.path, np.concatenate([random, hard]))
        seconds = time.process_time() - began
        rows.append({
            "object": name, "degrees": degrees, "random": f"{runs.arrived[:count].sum()}/{count}",
            "hard": f"{runs.arrived[count:].sum()}/{len(hard)}", "arrived": bool(runs.arrived.all()),
            "worst_distance": runs.worst_distance, "worst_angle_deg": runs.worst_angle, "seconds": seconds,
        })  # fmt: skip
    return rows, {"every certified start arrives": bool(rows) and all(r["arrived"] for r in rows)}


PARTS: dict[str, Part] = {"certificates": certificates, "executions": executions}

if __name__ == "__main__":
    sys.exit(run(PARTS, __doc__))
