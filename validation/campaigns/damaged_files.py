"""Read damaged and hostile variants of every kind of file that meeframe reads, and check the answer to each.

    uv run python validation/campaigns/damaged_files.py --number 20000 --seed 1 [--kind case --kind material]

Every answer must be a valid object or one MeeframeError whose text names the file and has at most MAX_MESSAGE
characters, within LIMIT seconds of processor time and MAX_MEMORY bytes of additional memory. Any other exception, a
crash of the process and a file created outside the folder of the variant are defects: they are printed with their
seeds, and the exit status is 1. The variant of a seed is the same whatever the number of variants; --keep FOLDER saves
those with defects.
"""

import argparse
import multiprocessing
import os
import resource
import shutil
import signal
import struct
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import h5py
import meshio
import mutations
import numpy as np
import problems
from meeframe_halfspace import Scales, read_height_map

import meeframe
from meeframe.cli.console import stdout
from meeframe.common.errors import MeeframeError
from meeframe.elements import ELEMENTS
from meeframe.indenters.heights import Heights
from meeframe.material import library_material, read_material, write_material
from meeframe.mesh.generators import box_mesh
from meeframe.mesh.reader import read_mesh
from meeframe.model.load import load_case
from meeframe.model.restart import read_restart
from meeframe.results.fclib import LocalProblem, LocalSolution, read_local, read_solution, write_local
from meeframe.results.files import read_result
from meeframe.results.summary import summary_json, summary_table
from meeframe.study.declare import load_study
from meeframe.study.sweep.pool import Pool
from meeframe.study.sweep.run import sweep

LIMIT: Final = 20
"""Longest processor time to an answer [s]."""
MAX_WAIT: Final = 10 * LIMIT
"""Longest time to an answer on a busy machine, or where a read waits forever [s]."""
HANGS: Final = MAX_WAIT + LIMIT
"""Time after which a process is killed [s]."""
MAX_MEMORY: Final = 2**31
"""Largest additional address space [bytes]."""
MAX_MESSAGE: Final = 20_000
X3P: Final = """<?xml version="1.0" encoding="UTF-8"?>
<p:ISO5436_2 xmlns:p="http://www.opengps.eu/2008/ISO5436_2"><Record1><Revision>ISO5436 - 2000</Revision>
<FeatureType>SUR</FeatureType><Axes><CX><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-6</Increment>
<Offset>0</Offset></CX><CY><AxisType>I</AxisType><DataType>D</DataType><Increment>1e-6</Increment><Offset>0</Offset></CY>
<CZ><AxisType>A</AxisType><DataType>D</DataType><Increment>1</Increment><Offset>0</Offset></CZ></Axes></Record1>
<Record3><MatrixDimension><SizeX>4</SizeX><SizeY>5</SizeY><SizeZ>1</SizeZ></MatrixDimension>
<DataLink><PointDataLink>bindata/data.bin</PointDataLink></DataLink></Record3></p:ISO5436_2>
"""
"""Index of an archive of ISO 25178-72."""
ROOT: Final = Path(__file__).parents[2]

TINY: Final = """
title = "tiny"
material = { name = "pzt-4" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 4 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 } }
conductivity = { electric = { name = "step", kappa = 1e-6 } }
output = { figures = false, vtu = false }
steps = [{ approach = "10 um", increments = 2 }, { translation = ["1 um", 0] }]
"""

FILM: Final = """
title = "film"
material = { name = "silicon" }
mesh = { type = "half-space", contact_width = "1.6 um", divisions = 4 }
formulation = { name = "half-space" }
base = { thickness = "500 um", electric = "grounded" }
conductivity = { electric = { name = "step", kappa = inf } }
indenter = { name = "sphere", radius = "10 um" }
output = { figures = false, vtu = false }
steps = [{ normal_force = "2 mN", electric_potential = "1 V" }, { charge = "0 C" }]

[[layers]]
material = "pzt-4"
thickness = "1 um"
interface = { electrode = "grounded" }

[[layers]]
material = "batio3"
thickness = "200 nm"
grading = { law = "power", exponent = 0.5, material = "cofe2o4", tolerance = 0.1 } # few sublayers

[[layers]]
material = "glass"
thickness = "200 nm"
interface = { normal_stiffness = 1e17, electric_conductance = 1e-3 }
"""
ROLLING: Final = """
title = "rolling"
material = { name = "steel" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 6 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 }, wear = { name = "archard", coefficient = "1e-16 1/Pa" } }
output = { figures = false, vtu = false }
steps = [
    { normal_force = "2 kN" },
    { rolling = { direction = [1, 0], distance = "2 mm", creepage = ["0.1 %", 0], spin = "0.5 1/m", speed = "2 m/s" } },
]
"""
CYCLES: Final = """
title = "cycles"
material = { name = "steel" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 6 }
formulation = { name = "half-space" }
indenter = { name = "sphere", radius = "100 mm" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 }, wear = { name = "archard", coefficient = "1e-16 1/Pa" } }
output = { figures = false, vtu = false }
steps = [
    { normal_force = "2 kN", sliding = 0 },
    { rolling = { steady = true, creepage = ["0.2 %", 0], cycles = 20, wear_tolerance = 0.2 }, increments = 2 },
]
"""
HEAT: Final = """
title = "heat"
material = { name = "batio3-cofe2o4", thermal = true }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 4 }
formulation = { name = "half-space", reference_radius = "10 mm" }
indenter = { name = "sphere", radius = "100 mm", temperature = "20 K" }
contact = { law = { name = "isotropic-coulomb", mu = 0.3 }, friction_heat = 0.5 }
conductivity = { thermal = { name = "step", kappa = 1e4 } }
output = { figures = false, vtu = false }
steps = [
    { approach = "10 um", duration = "1 s" },
    { translation = ["1 um", 0], temperature = "30 K", duration = "1 s" },
    { heat = "0 W", normal_force = "100 N", duration = "1 s" },
]
"""
WEAR: Final = """
title = "wear"
material = { name = "steel" }
mesh = { type = "half-space", contact_width = "5 mm", divisions = 4 }
formulation = { name = "half-space", edges = "resolved" }
indenter = { name = "flat-punch", radius = "1.5 mm" }
contact = { wear = { name = "archard", coefficient = "1e-14 1/Pa" } }
output = { figures = false, vtu = false }
steps = [{ normal_force = "100 N" }, { sliding = "1 m", max_pressure_change = 0.5, increments = 2 }]
"""
FEATURES: Final = {"film": FILM, "rolling": ROLLING, "cycles": CYCLES, "heat": HEAT, "wear": WEAR}


class _TooSlow(BaseException):
    """The answer takes longer than LIMIT or MAX_WAIT."""


class _Reached(BaseException):
    """A sweep has been checked, and would begin to solve."""


class _NoPool(Pool):
    def solve(self, points: Any, systems: Any, progress: Any) -> Iterator[Any]:
        raise _Reached


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    make: writes valid files into a folder and returns them, each a file or a folder with a single file to change; use:
    reads a file or folder of meeframe; change: changes it in place; weight: number of variants, relative to others;
    package: optional one that reads it, without which the kind is left out.
    """

    make: Callable[[Path], Sequence[Path]]
    use: Callable[[Path], object]
    change: Callable[[Path, mutations.Random], None]
    weight: float = 0.1
    package: str | None = None

    @property
    def is_readable(self) -> bool:
        """True unless a package is missing."""
        return self.package is None or find_spec(self.package) is not None


def _text(path: Path, random: mutations.Random) -> None:
    changed = mutations.text(path.read_text(encoding="utf-8", errors="surrogateescape"), random)
    path.write_text(changed, encoding="utf-8", errors="surrogateescape")


def _bytes(path: Path, random: mutations.Random) -> None:
    path.write_bytes(mutations.binary(path.read_bytes(), random))


def _hdf5(path: Path, random: mutations.Random) -> None:
    mutations.hdf5(path, random)


def _either(path: Path, random: mutations.Random) -> None:
    (_text if random.random() < 0.7 else _bytes)(path, random)


def _cases(folder: Path) -> list[Path]:
    sources = [*sorted((ROOT / "meeframe/examples").glob("*.toml"))]
    sources += sorted((ROOT / "plugins/meeframe-laws/cases").glob("*.toml"))
    paths = [Path(shutil.copy(source, folder)) for source in sources]
    for seed in range(20):
        path = folder / f"drawn-{seed}.toml"
        path.write_text(problems.draw(seed, folder), encoding="utf-8")
        paths.append(path)
    return paths


def _feature_cases(folder: Path) -> list[Path]:
    paths = []
    for name, text in FEATURES.items():
        paths.append(folder / f"{name}.toml")
        paths[-1].write_text(text, encoding="utf-8")
    return paths


def _studies(folder: Path) -> list[Path]:
    (folder / "tiny.toml").write_text(TINY, encoding="utf-8")
    study = folder / "study.toml"
    study.write_text(
        """title = "friction"
case = "tiny.toml"
set = { "solver.tolerance" = 1e-8 }
fields = ["pressure"]
every_increment = false

[axes]
"contact.law.mu" = [0.0, 0.1, 0.3]
"steps[1].approach" = { from = 1e-5, to = 2e-5, count = 2, scale = "log" }

[axes.condition]
EMII = {}
EMCI = { "conductivity.electric" = { name = "step", kappa = inf } }

[[points]]
label = "frictionless"
set = { "contact.law" = "signorini" }

[[plots]]
quantities = ["normal_force", "charge"]
""",
        encoding="utf-8",
    )
    return [study]


def _check_study(path: Path) -> None:
    with suppress(_Reached):
        sweep(path, path.parent / "out", _NoPool())


def _figures(folder: Path) -> list[Path]:
    sources = sorted((ROOT / "validation").glob("*/fig-*.toml"))
    for case in (ROOT / "validation").glob("*/em*.toml"):
        shutil.copy(case, folder)
    return [Path(shutil.copy(source, folder)) for source in sources]


def _materials(folder: Path) -> list[Path]:
    paths = []
    for name in ("pzt-4", "batio3-cofe2o4", "linbo3", "pvdf", "tungsten"):
        paths.append(folder / f"{name}.toml")
        write_material(library_material(name), paths[-1])
    return paths


def _grid() -> np.ndarray[Any, np.dtype[np.float64]]:
    x, y = np.meshgrid(np.linspace(-1e-3, 1e-3, 5), np.linspace(-1e-3, 1e-3, 4))
    return np.column_stack([x.ravel(), y.ravel(), 1e-6 * np.random.default_rng(0).random(20)])


def _heights_npy(folder: Path) -> list[Path]:
    paths = [folder / "rows.npy", folder / "integers.npy"]
    np.save(paths[0], _grid())
    np.save(paths[1], np.arange(12).reshape(4, 3))
    return paths


def _heights_txt(folder: Path) -> list[Path]:
    paths = [folder / "rows.txt", folder / "commas.csv"]
    np.savetxt(paths[0], _grid(), header="x y height")
    np.savetxt(paths[1], _grid(), delimiter=",")
    return paths


def _evaluate(path: Path) -> None:
    x = np.linspace(-1e-3, 1e-3, 3)
    for interpolation in ("linear", "cubic"):
        with suppress(MeeframeError):
            Heights(path, interpolation).height(x, x)
    Heights(path, "nodes").height(np.array([-1e-3]), np.array([-1e-3]))


def _maps_txt(folder: Path) -> list[Path]:
    heights = _grid()[:, 2].reshape(4, 5)
    numbers = "\n".join(" ".join(f"{value:.6e}" for value in each) for each in heights)
    contents = {
        "surfer.grd": f"DSAA\n5 4\n-1 1\n-1 1\n0 1e-6\n{numbers}\n",
        "esri.asc": f"ncols 5\nnrows 4\nxllcorner 0\nyllcorner 0\ncellsize 1e-6\nnodata_value -9999\n{numbers}\n",
        "matrix.txt": f"# Channel: Height\n# Width: 20 um\n# Height: 16 um\n# Value units: nm\n{numbers}\n",
    }
    for name, content in contents.items():
        (folder / name).write_text(content, encoding="utf-8")
    return [folder / name for name in contents]


def _map(path: Path) -> None:
    read_height_map(path, Scales(spacing=(1e-6, 1e-6)) if path.stem.startswith("spaced") else None)


def _maps_npy(folder: Path) -> list[Path]:
    np.save(folder / "spaced.npy", _grid()[:, 2].reshape(4, 5))
    np.save(folder / "rows.npy", _grid())
    return [folder / "spaced.npy", folder / "rows.npy"]


def _maps_hdf5(folder: Path) -> list[Path]:
    path = folder / "spaced.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("map/heights", data=_grid()[:, 2].reshape(4, 5), chunks=(2, 5), compression="gzip")
        file.attrs["unit"] = "m"
    return [path]


def _instruments(folder: Path) -> list[Path]:
    """Write a file of Gwyddion, an archive of ISO 25178-72 and a file of SurfaceTopography itself."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from SurfaceTopography import Topography  # optional, and slow to import

    heights = _grid()[:, 2].reshape(4, 5)

    def item(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + value

    def container(name: str, *items: bytes) -> bytes:
        body = b"".join(items)
        return name.encode() + b"\0" + struct.pack("<I", len(body)) + body

    field = container(
        "GwyDataField",
        *(item(name, "i", struct.pack("<i", value)) for name, value in (("xres", 4), ("yres", 5))),
        *(item(name, "d", struct.pack("<d", value)) for name, value in (("xreal", 4e-6), ("yreal", 5e-6))),
        *(
            item(name, "o", container("GwySIUnit", item("unitstr", "s", b"m\0")))
            for name in ("si_unit_xy", "si_unit_z")
        ),
        item("data", "D", struct.pack("<I", heights.size) + heights.T.astype("<f8").tobytes()),
    )
    items = item("/0/data", "o", field), item("/0/data/title", "s", b"Height\0")
    (folder / "map.gwy").write_bytes(b"GWYP" + container("GwyContainer", *items))
    with zipfile.ZipFile(folder / "map.x3p", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("main.xml", X3P)
        archive.writestr("bindata/data.bin", heights.T.astype("<f8").tobytes())
    Topography(heights, (4e-6, 5e-6), unit="m").to_netcdf(str(folder / "map.nc"))
    return [folder / name for name in ("map.gwy", "map.x3p", "map.nc")]


def _meshes(folder: Path, formats: Sequence[tuple[str, str]]) -> list[Path]:
    mesh = box_mesh((2.0, 2.0, 6.0), (2, 2, 3), ELEMENTS["tri3"])
    (cells,) = mesh.blocks
    data = meshio.Mesh(mesh.points, [("triangle", cells.connectivity)], cell_data={"faces": [cells.groups]})
    plain = meshio.Mesh(mesh.points, [("triangle", cells.connectivity)])
    paths = []
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        for suffix, kind in formats:
            paths.append(folder / f"mesh-{kind}{suffix}")
            meshio.write(paths[-1], data if kind in WITH_DATA else plain, file_format=kind)
    return paths


WITH_DATA: Final = ("gmsh22", "gmsh", "vtu", "vtk")
TEXT_MESHES: Final = (
    *((".msh", "gmsh22"), (".vtu", "vtu"), (".off", "off"), (".obj", "obj"), (".inp", "abaqus"), (".bdf", "nastran")),
    *((".mesh", "medit"), (".ply", "ply"), (".stl", "stl"), (".dat", "tecplot")),
    (".xml", "dolfin-xml"),
)
BINARY_MESHES: Final = ((".msh", "gmsh"), (".vtk", "vtk"), (".vtu", "vtu"), (".ply", "ply"), (".stl", "stl"))
HDF5_MESHES: Final = ((".med", "med"), (".h5m", "h5m"), (".cgns", "cgns"), (".hmf", "hmf"))


def _mesh(path: Path) -> None:
    read_mesh(path, ELEMENTS.values(), merge_tolerance=1e-6)


def _fclib(folder: Path) -> list[Path]:
    matrix, path = np.eye(6) + 0.1, folder / "local.hdf5"
    solution = LocalSolution(np.zeros(6), np.array([1.0, 0, 0, 1, 0, 0]))
    write_local(path, LocalProblem(matrix, -np.ones(6), np.array([0.3, 0.5]), "a title"), solution)
    return [path]


def _read_fclib(path: Path) -> None:
    read_local(path)
    read_solution(path)


def _results(folder: Path) -> list[Path]:
    return [_run("result", TINY, folder)]


def _feature_results(folder: Path) -> list[Path]:
    return [_run(name, text, folder) for name, text in FEATURES.items()]


def _run(name: str, text: str, folder: Path) -> Path:
    case = folder / f"{name}.toml"
    case.write_text(text, encoding="utf-8")
    meeframe.run(case, folder / name, overwrite=True)
    return folder / name


def _read_result(path: Path) -> None:
    result = read_result(path)
    if result.steps:
        summary_json(result)
        with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
            stdout().print(summary_table(result))
    with suppress(meeframe.CaseError):  # none of the increments has converged
        read_restart(path)


def _continue(path: Path) -> None:
    case = path.parent / "continued.toml"
    case.write_text(FEATURES.get(path.name, TINY) + f"\n[restart]\nfrom = {str(path)!r}\n", encoding="utf-8")
    meeframe.run(load_case(case), path.parent / "continued", overwrite=True)


KINDS: Final = {
    "case": Kind(_cases, load_case, _text, 1.0),
    "case-bytes": Kind(_cases, load_case, _bytes),
    "case-features": Kind(_feature_cases, load_case, _text, 1.0),
    "study": Kind(_studies, _check_study, _text, 1.0),
    "figure": Kind(_figures, load_study, _text),
    "material": Kind(_materials, read_material, _text, 1.0),
    "heights-npy": Kind(_heights_npy, _evaluate, _bytes),
    "heights-text": Kind(_heights_txt, _evaluate, _either),
    "map-npy": Kind(_maps_npy, _map, _bytes),
    "map-text": Kind(_maps_txt, _map, _either),
    "map-hdf5": Kind(_maps_hdf5, _map, _hdf5),
    "map-hdf5-bytes": Kind(_maps_hdf5, _map, _bytes),
    "map-instrument": Kind(_instruments, _map, _bytes, package="SurfaceTopography"),
    "mesh-text": Kind(lambda folder: _meshes(folder, TEXT_MESHES), _mesh, _either),
    "mesh-bytes": Kind(lambda folder: _meshes(folder, BINARY_MESHES), _mesh, _bytes),
    "mesh-hdf5": Kind(lambda folder: _meshes(folder, HDF5_MESHES), _mesh, _hdf5),
    "fclib": Kind(_fclib, _read_fclib, _hdf5),
    "fclib-bytes": Kind(_fclib, _read_fclib, _bytes),
    "result": Kind(_results, _read_result, _hdf5),
    "result-bytes": Kind(_results, _read_result, _bytes),
    "result-features": Kind(_feature_results, _read_result, _hdf5),
    "restart": Kind(_results, _continue, _hdf5, 0.02),
    "restart-features": Kind(_feature_results, _continue, _hdf5, 0.02),
}


def answer(name: str, template: Path, seed: int, folder: Path) -> tuple[str, str]:
    """Return the outcome and the words about a variant, which is written into an empty folder.

    Outcomes: valid, refused, or a defect: slow, memory, exception, unnamed, verbose, outside.
    """
    kind, random = KINDS[name], np.random.default_rng([seed, sum(name.encode())])
    path = folder / template.name
    if template.is_dir():
        shutil.copytree(template, path)
        kind.change(path / "result.h5", random)
    else:
        for sibling in template.parent.iterdir():
            if sibling.is_file() and (sibling == template or sibling.stat().st_size < 10_000):
                shutil.copy(sibling, folder)
        kind.change(path, random)
    outside = set(folder.parent.iterdir())
    limits = ((signal.SIGPROF, signal.ITIMER_PROF, LIMIT), (signal.SIGALRM, signal.ITIMER_REAL, MAX_WAIT))
    for number, timer, seconds in limits:
        signal.signal(number, _raise_too_slow)
        signal.setitimer(timer, seconds)
    try:
        outcome = _use(kind, path)
    finally:
        for _, timer, _ in limits:
            signal.setitimer(timer, 0)
    added = set(folder.parent.iterdir()) - outside
    return ("outside", str(added)) if added else outcome


def _use(kind: Kind, path: Path) -> tuple[str, str]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            kind.use(path)
    except MeeframeError as error:
        text = str(error)
        if str(path.parent) not in text and path.stem not in text:
            return "unnamed", text
        return ("verbose" if len(text) > MAX_MESSAGE else "refused"), text
    except _TooSlow:
        return "slow", traceback.format_exc()
    except MemoryError:
        return "memory", traceback.format_exc()
    except BaseException:
        return "exception", traceback.format_exc()
    return "valid", ""


def _raise_too_slow(*_: object) -> None:
    raise _TooSlow


GOOD: Final = ("valid", "refused")


def campaign(name: str, seeds: Sequence[int], keep: Path | None = None) -> Iterator[tuple[int, str, str]]:
    """Yield the seed, outcome and words of each variant of a kind; a process that crashes is started again."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:  # an interrupted process may write
        folder = Path(temporary)
        (folder / "valid").mkdir()
        templates = list(KINDS[name].make(folder / "valid"))
        waiting = list(seeds)
        while waiting:
            receiver, sender = multiprocessing.Pipe(duplex=False)
            process = multiprocessing.get_context("fork").Process(
                target=_serve, args=(name, templates, waiting, folder, sender, keep), daemon=True
            )
            process.start()
            sender.close()
            done = 0
            with suppress(EOFError):
                while done < len(waiting) and receiver.poll(HANGS):
                    yield receiver.recv()
                    done += 1
            process.join(0 if done == len(waiting) else 1)
            if process.is_alive() and done < len(waiting):
                process.kill()  # compiled code takes no notice of the alarm
            process.join()
            if done < len(waiting):
                yield waiting[done], "crash", f"exit status {process.exitcode}"
                done += 1
            waiting = waiting[done:]


def _serve(
    name: str, templates: Sequence[Path], seeds: Sequence[int], folder: Path, sender: Any, keep: Path | None
) -> None:
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MAX_MEMORY, size + MAX_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with suppress(Exception), open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        for template in templates:  # compiles and loads what is used once in a process
            KINDS[name].use(template)
    for seed in seeds:
        room = folder / "variants" / "one"
        shutil.rmtree(room.parent, ignore_errors=True)
        room.mkdir(parents=True)
        outcome, words = answer(name, templates[seed % len(templates)], seed, room)
        if outcome not in GOOD and keep is not None:
            shutil.copytree(room, keep / f"{name}-{seed}", dirs_exist_ok=True, ignore_dangling_symlinks=True)
        sender.send((seed, outcome, words))


def main() -> int:
    """Run campaigns and print their table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=1000, help="variants of a case file; of other kinds fewer")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="repeatable; all by default")
    parser.add_argument("--only", type=int, nargs="+", help="seeds")
    parser.add_argument("--keep", type=Path, metavar="FOLDER")
    parser.add_argument("--verbose", action="store_true", help="print messages of refused files, too")
    options = parser.parse_args()
    defects = 0
    for name in options.kind or KINDS:
        if not KINDS[name].is_readable:
            print(f"{name:16}  left out: {KINDS[name].package} is not installed", flush=True)
            continue
        count = max(1, round(options.number * KINDS[name].weight))
        counts: Counter[str] = Counter()
        interrupted = False
        try:
            for seed, outcome, words in campaign(
                name, options.only or range(options.seed, options.seed + count), options.keep
            ):
                counts[outcome] += 1
                if outcome not in GOOD or options.verbose:
                    print(f"{name} {seed}: {outcome}: {words[-3000:]}", flush=True)
        except KeyboardInterrupt:  # what was found until then is printed
            interrupted = True
        defects += sum(count for outcome, count in counts.items() if outcome not in GOOD)
        print(f"{name:16}", *(f"{outcome} {count}" for outcome, count in counts.most_common()), sep="  ", flush=True)
        if interrupted:
            return 130
    return int(defects > 0)


if __name__ == "__main__":
    sys.exit(main())
