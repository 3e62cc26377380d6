"""Solve random problems and judge every converged increment again from its result file alone.

    uv run python validation/campaigns/random_problems.py --number 1000 --seed 1 [--solver NAME] [--workers N]
    uv run python validation/campaigns/random_problems.py --number 1000 --seed 1 --record FILE
    uv run python validation/campaigns/random_problems.py --only 1003 --out FOLDER

Problem k of a campaign has the seed `seed + k`, and is the same whatever the number of problems. The table counts the
increments that converged, stalled with a reason (prescribed loads beyond what the laws resist), stalled without one,
diverged, and are wrong: called converged although a law, a balance or the compliance is violated by more than TOLERANCE
relative to the magnitudes of the solution. A record holds each answer as soon as it is known, so that the same command
continues after a stop. The exit status is 1 if any increment is wrong or any run fails.
"""

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from itertools import chain
from pathlib import Path
from typing import Final

import judge
import numpy as np
import problems
from scipy.spatial import cKDTree

import meeframe
from meeframe.formulations.base import Formulation
from meeframe.mesh.body import Body
from meeframe.model.case import Case
from meeframe.model.load import load_case
from meeframe.model.solve import bodies_of

TOLERANCE: Final = 1e-6
"""Largest violation of a converged increment, relative to the magnitudes of its solution."""

REASONS: Final = (
    "more than friction bears",
    "add up to the prescribed forces",
    "does not touch",
    "no node conducts it",
)
"""Words in the message of an increment that did not converge which state a reason that no solver can remove."""


@dataclass
class Answer:
    """Answer to one problem: outcome of each increment, and words about those that matter."""

    seed: int
    outcomes: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    worst: float = 0.0
    seconds: float = 0.0


def answer(seed: int, solver: str, out: Path | None = None) -> Answer:
    """Solve the problem of a seed in a folder, a temporary one by default, and judge its result."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as temporary:
        folder = out or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "case.toml"
        file.write_text(problems.draw(seed, folder, solver), encoding="utf-8")
        result = Answer(seed)
        try:
            _judge(load_case(file), folder / "results", result)
        except meeframe.MeeframeError as error:
            result.outcomes.append("rejected")
            result.notes.append(f"rejected: {error}")
        except Exception:
            result.outcomes.append("exception")
            result.notes.append(traceback.format_exc())
    result.seconds = time.process_time() - begun
    return result


def _judge(case: Case, folder: Path, result: Answer) -> None:
    meeframe.run(case, folder, overwrite=True)
    file = judge.read(folder)
    compliances = tuple(compliance(*each) for each in bodies_of(case)[::-1])
    for increment, violations in zip(file.increments, judge.judge(file, compliances), strict=True):
        where = f"step {increment.number[0]}.{increment.number[1]}"
        if increment.status != "converged":
            has_reason = any(reason in increment.message for reason in REASONS)
            result.outcomes.append(f"{increment.status}{', with a reason' if has_reason else ''}")
            result.notes.append(f"{where}: {increment.status}: {increment.message}")
            continue
        worst = max(violations.values())
        result.worst = max(result.worst, worst)
        result.outcomes.append("converged" if worst <= TOLERANCE else "wrong")
        if worst > TOLERANCE:
            named = ", ".join(f"{name} {value:.1e}" for name, value in violations.items() if value > TOLERANCE)
            result.notes.append(f"{where}: wrong: {named}")


def compliance(formulation: Formulation, body: Body) -> judge.Compliance:
    """Return the compliance of a body, reduced again."""
    system = formulation.reduce(body)
    tree = cKDTree(system.points)

    def apply(points: judge.Array, load: judge.Array) -> judge.Array:
        nodes = tree.query(points)[1]
        local = np.zeros_like(load)
        local[nodes, :3] = np.einsum("nai,ni->na", system.frames[nodes], load[:, :3])
        local[nodes, 3:] = load[:, 3:]
        displacement = (system.offset + system.apply(local))[nodes]
        displacement[:, :3] = np.einsum("nai,na->ni", system.frames[nodes], displacement[:, :3])
        return displacement

    return apply


def answers(seeds: list[int], solver: str, workers: int) -> Iterator[Answer]:
    """Yield the answers to problems, those of several workers as they come."""
    if workers == 1:
        yield from (answer(seed, solver) for seed in seeds)
        return
    with ProcessPoolExecutor(workers) as pool:
        try:
            for future in as_completed([pool.submit(answer, seed, solver) for seed in seeds]):
                yield future.result()
        finally:  # after an interruption too
            pool.shutdown(cancel_futures=True)


def recorded(record: Path, seeds: list[int]) -> list[Answer]:
    """Return the answers to given seeds that a record holds, after removing a last line that a stop cut off."""
    if not record.exists():
        return []
    lines = record.read_text(encoding="utf-8").splitlines(keepends=True)
    complete = [line for line in lines if line.endswith("\n")]
    if len(complete) < len(lines):
        record.write_text("".join(complete), encoding="utf-8")
    return [each for each in (Answer(**json.loads(line)) for line in complete) if each.seed in set(seeds)]


def main() -> int:
    """Run a campaign and print its table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="+", help="seeds of the problems to solve")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="folder in which a single problem and its results remain")
    parser.add_argument("--record", type=Path, help="file that receives each answer; those in it are not sought again")
    options = parser.parse_args()
    seeds = options.only or list(range(options.seed, options.seed + options.number))
    known = recorded(options.record, seeds) if options.record else []
    missing = [seed for seed in seeds if seed not in {each.seed for each in known}]
    if options.out:
        done = iter([answer(seeds[0], options.solver, options.out)])
    else:
        done = chain(known, answers(missing, options.solver, options.workers))
    counts: Counter[str] = Counter()
    worst = slowest = 0.0
    number = 0
    try:
        for number, each in enumerate(done, 1):
            counts.update(each.outcomes)
            if options.record and number > len(known):
                with options.record.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(each)) + "\n")
            print(f"{number}/{len(seeds)}: {each.seed}, {each.seconds:.1f} s", end="\r", file=sys.stderr)
            worst, slowest = max(worst, each.worst), max(slowest, each.seconds)
            for note in each.notes:
                print(f"{each.seed}: {note}", flush=True)
    except KeyboardInterrupt:
        print("interrupted")
    print(f"\n{number} problems, {sum(counts.values())} increments")
    for outcome, count in counts.most_common():
        print(f"{outcome:36} {count:6}")
    solved = Counter({outcome: count for outcome, count in counts.items() if outcome != "rejected"})
    without = sum(count for outcome, count in solved.items() if outcome.endswith(", with a reason"))
    for words, total in (("all increments", solved.total()), ("those without a reason", solved.total() - without)):
        print(f"converged of {words}: {solved['converged'] / max(total, 1):.2%}")
    print(f"largest violation {worst:.1e}, slowest problem {slowest:.1f} s of processor time")
    return int(any(counts[name] for name in ("wrong", "exception")))


if __name__ == "__main__":
    sys.exit(main())
