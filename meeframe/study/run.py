"""Run of a case into files: every finished increment, then result.h5, summary.json, figures and fields.vtu."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from meeframe.common.errors import named_in
from meeframe.fields import N_MECHANICAL, THERMAL_FIELD
from meeframe.laws.base import has_friction
from meeframe.mesh.body import Body
from meeframe.model.case import Case
from meeframe.model.clock import Clock, peak_memory_mb
from meeframe.model.load import load_case
from meeframe.model.solve import bodies_of, provenance, reduce, solve_steps
from meeframe.plugin.registry import Registry
from meeframe.results.figures import write_figures
from meeframe.results.files import ResultWriter, stored_steps
from meeframe.results.output import RESULT_FILE, SUMMARY_FILE, clear_output, open_output, replacing
from meeframe.results.overview import StoredSteps, overview
from meeframe.results.records import zone_of
from meeframe.results.result import Interrupted, Result
from meeframe.results.schema import FRICTION, SLIP, WEAR, loaded_fields
from meeframe.results.selection import Choice
from meeframe.results.summary import summary_json
from meeframe.results.vtk import FieldsWriter
from meeframe.system.reduced import Progress, silent


def run(
    case: Case | str | Path,
    out: str | Path,
    overwrite: bool = False,
    progress: Progress = silent,
    held: bool = True,
    registry: Registry | None = None,
) -> Result:
    """Solve a case and write its results into a folder.

    Nothing in the folder is touched before the first increment is finished. From then on, finished increments can be
    read from it whatever happens. An interruption, or an error after a finished increment, carries a note on the
    contents of the folder; an interruption while increments are solved is an Interrupted with their result.

    Parameters
    ----------
    case
        The case, or the path of its file.
    out
        Output folder; created if it does not exist and locked until the run ends.
    overwrite
        Whether results of an earlier run in it are replaced.
    progress
        Called with the stage and the fraction of it that is done.
    held
        Whether increments stay in memory. Otherwise they are read from the folder whenever they are asked for, so that
        memory does not grow with their number; reports do not ask for them.
    registry
        Registry in which the names in a case file are looked up; by default the built-ins and the installed plugins.

    Returns
    -------
    Result
        Results of all increments.

    Raises
    ------
    ResultError
        Before anything is computed, if `out` cannot be written, if another run writes there, or if it is not empty and
        overwrite is false.
    MeeframeError
        As load_case and solve_case; errors name the case file.
    """
    clock = Clock(progress)
    clock("reading", 0.0)
    loaded = case if isinstance(case, Case) else load_case(case, registry)
    folder = Path(out)
    with open_output(folder, overwrite), named_in("" if isinstance(case, Case) else str(case)):
        loaded.check_memory_of_run()
        return _Run(loaded, folder, clock, held).run()


def stored_fields(case: Case) -> frozenset[str]:
    """Return the optional fields stored in the result file of a case.

    By default these are the fields that the case loads. The slips of a run that continues another one, or slides a
    distance, are always stored, because they cannot be computed from its displacements alone.
    """
    needed = case.restart is not None or any(step.sliding is not None for step in case.steps)
    loaded = loaded_fields(needed or has_friction(case.contact_law))
    if case.output.fields is None:
        return loaded
    return frozenset(case.output.fields) | (loaded_fields(True) - loaded_fields(False) if needed else frozenset())


def possible_phenomena(case: Case) -> set[str]:
    """Return the phenomena that increments of a case may show, by which its files have the same fields at all times.

    See `meeframe.results.schema.is_present`.
    """
    friction = case.restart is not None or has_friction(case.contact_law)
    phenomena = {FRICTION, SLIP} if friction else set()
    if case.wear is not None:
        phenomena |= {WEAR, SLIP}
    for number, (scalar, channel) in enumerate(zip(case.fields.scalars, case.channels, strict=True), N_MECHANICAL):
        is_heated = scalar.name == THERMAL_FIELD.name and max(case.friction_heat, case.joule_heat) > 0.0
        if channel.is_conducting or is_heated or any(_acts_on(body, number) for _, body in bodies_of(case)):
            phenomena.add(scalar.name)
    return phenomena


def _acts_on(body: Body, number: int) -> bool:
    """Return whether loads or boundary conditions of a body act on the scalar field of a column."""
    stiffnesses = [body.stiffness, *(layer.material.stiffness for layer in body.layers.layers)]
    coupled = any(np.delete(stiffness[:, number], number, axis=1).any() for stiffness in stiffnesses)
    return coupled or any(condition.field == number and np.any(condition.data) for condition in body.conditions)


class _Run:
    """One run into an output folder."""

    def __init__(self, case: Case, folder: Path, clock: Clock, held: bool) -> None:
        self._case, self._folder, self._clock, self._held = case, folder, clock, held
        self._earlier = (folder / RESULT_FILE).is_file()
        self._cleared = False
        self._finished = 0
        self._result: Result | None = None

    def run(self) -> Result:
        """Solve the case and write everything."""
        try:
            return self._solve()
        except KeyboardInterrupt as error:
            interrupted = error if self._result is None else Interrupted(self._result)
            interrupted.add_note(self._content())
            raise interrupted from None
        except MemoryError as error:
            error.add_note(self._content())
            raise
        except BaseException as error:  # plugins may also raise SystemExit and the like
            if self._cleared:
                error.add_note(self._content())
            raise

    def _solve(self) -> Result:
        system = reduce(self._case, self._clock)
        result = Result(provenance(self._case), zone_of(system), self._case.n_increments)
        if not self._held:
            result = replace(result, steps=StoredSteps(partial(stored_steps, self._folder, result.zone)))
        self._result = result
        writer = ResultWriter(self._folder, result, stored_fields(self._case))
        output = self._case.output
        drawn = Choice(output.step)
        fields, failure = FieldsWriter(self._folder, result.zone, possible_phenomena(self._case)), None
        try:
            for step in solve_steps(self._case, system, self._clock):
                self._clock("writing", 0.0)
                if not self._cleared:
                    self._cleared = True
                    clear_output(self._folder)
                writer.append(step)
                self._finished += 1
                if isinstance(result.steps, StoredSteps):
                    result.steps.add(result.zone, step)
                else:
                    self._result = result = replace(result, steps=(*result.steps, step))
                if output.figures:
                    drawn.add(step, overview(step, result.zone))
                if output.vtu and failure is None:
                    if step.boundary is not None:
                        self._clock("fields", 0.0)
                    try:
                        fields.add(step)
                    except Exception as error:  # the other increments are solved all the same
                        failure = error
            if output.figures:
                self._clock("figures", 0.0)
                write_figures(result, self._folder, drawn.step)
            if failure is not None:
                raise failure
            if output.vtu:
                self._clock("fields", 0.0)
                fields.finish()
        except BaseException:
            fields.discard()
            raise
        finally:
            if result.steps:
                result = self._finish(writer, result)
        return result

    def _finish(self, writer: ResultWriter, result: Result) -> Result:
        self._clock("writing", 0.0)
        result = writer.finish(lambda: replace(result, timings=self._clock.timings(), peak_memory_mb=peak_memory_mb()))
        with replacing(self._folder / SUMMARY_FILE) as path, path.open("w", encoding="utf-8") as file:
            file.writelines(summary_json(result))
        return result

    def _content(self) -> str:
        """Describe the present contents of the folder."""
        if self._finished:
            return f"{self._finished} of {self._case.n_increments} increments are finished and in {self._folder}"
        if not self._earlier:
            return f"no increment was finished; nothing was written to {self._folder}"
        if self._cleared:
            return f"no increment was finished; the results of an earlier run are gone from {self._folder}"
        return f"no increment was finished; {self._folder} holds the results of an earlier run as before"
