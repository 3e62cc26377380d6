"""Plugin of the benchmark of sweeps: dense boundary elements that write down each of their reductions."""

from dataclasses import dataclass
from pathlib import Path

from meeframe.formulations.dense_bem import DenseBEM
from meeframe.plugin import Formulation, Record, hookimpl, silent


@dataclass(frozen=True)
class Counted(Formulation):
    """As DenseBEM. log: file with a line for each reduction, from any process."""

    log: str

    def check(self, body):
        DenseBEM().check(body)

    def reduce(self, body, progress=silent):
        with Path(self.log).open("a", encoding="utf-8") as file:
            file.write("reduced\n")
        return DenseBEM().reduce(body, progress)


@hookimpl
def meeframe_formulations():
    return [Record("counted", Counted, "dense boundary elements, counted", "benchmark of sweeps")]
