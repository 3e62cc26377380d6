"""Plugin for the benchmark of sweeps: dense boundary elements that log each reduction."""

from dataclasses import dataclass
from pathlib import Path

from meeframe.formulations.dense_bem import DenseBEM
from meeframe.plugin import Formulation, Record, hookimpl, silent


@dataclass(frozen=True)
class Counted(Formulation):
    """DenseBEM that appends a line to the file `log` for each reduction, in any process."""

    log: str

    def check(self, body):
        DenseBEM().check(body)

    def reduce(self, body, progress=silent):
        with Path(self.log).open("a", encoding="utf-8") as file:
            file.write("reduced\n")
        return DenseBEM().reduce(body, progress)


@hookimpl
def meeframe_formulations():
    return [Record("counted", Counted, "dense boundary elements with a log of reductions", "benchmark of sweeps")]
