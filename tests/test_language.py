"""Docstrings of code, tests and validation open with complete sentences; names come from the terms of the field."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDERS = ("meeframe", "plugins", "tests", "validation")
FILES = sorted(
    path
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*.py")
    if not {"build", ".venv"} & set(path.relative_to(ROOT).parts)
)
PACKAGE_FILES = [
    path for path in FILES if re.match(r"(plugins/[^/]+/)?meeframe(_\w+)?/", path.relative_to(ROOT).as_posix())
]
OPENINGS = re.compile(r"(Of|What|Whether|That|See|As|How|Where|The same|Those)\b")

# discouraged names and their replacements
DIALECT = {
    "own_response": "diagonal",
    "block_response": "apply_fields",
    "rough_response": "apply_fields",
    "roughly_ahead": "approximate_relative_displacement",
    "RoughInverse": "ApproximateInverse",
    "ROUGH": "APPROXIMATE_TOLERANCE",
    "restored": "from_arrays",
    "kept_of": "to_arrays",
    "spilt": "has_contact_outside",
    "Inset": "ContactNeighbourhood",
    "inverse_of_softer": "rescale_inverse",
    "endless": "is_periodic",
    "Edges": "EdgeCorrection",
    "EdgedSystem": "EdgeCorrectedSystem",
    "Rim": "IndenterEdge",
    "TurnedSystem": "RotatedSystem",
    "turned": "rotated",
    "PairSystem": "TwoBodySystem",
    "once_for_each": "memoize_by_identity",
    "Freedom": "PrescribedResultant",
    "aimed": "tolerance of init",
    "patience": "stall_window",
    "stride": "check_interval",
    "lawful_traction": "fixed_point_map",
    "judged": "evaluate_residual",
    "_stated": "decoupled_rows",
    "relaxed_edge": "smooth_contact_edge",
    "relaxed_slip": "smooth_slip_boundary",
    "moved_by": "take_step",
    "tensed": "with_signed_gap",
    "_telling": "coarse_representative",
    "Grazing": "BiactiveNodes",
    "doubts": "diagnostics",
    "outlook": "preflight",
    "Arrivals": "ContactOnsets",
    "unheard": "ignore",
    "Pending": "AccumulatedUpdate",
    "Pyramid": "MultilevelExtension",
    "idle_potentials": "unused_potentials",
    "FEWEST": "a constant that says what it bounds",
    "ENOUGH": "a constant that says what it bounds",
    "reachable_start": "start_below_indenter",
    "solve_part": "solve_attempt",
    "_PART_OF_WINDOW": "a ratio",
    "FEW": "a constant that says what it bounds",
    "HARDLY": "a constant that says what it bounds",
    "TELLING": "a constant that says what it bounds",
}
# words with several meanings, which names in packages do not contain, and what to say instead
AMBIGUOUS = {
    "ahead": "next",
    "found": "the noun for what is found",
    "kept": "the noun for what is stored",
    "moved": "displacement or motion",
    "own": "of the node itself",
    "reach": "feasible for equilibrium, contact for a boundary, highest for a value",
    "reachable": "feasible",
    "reached": "in contact for a boundary, highest for a value",
    "turned": "rotated",
    "unreachable": "infeasible",
    "whole": "total",
}
DISCOURAGED = re.compile(rf"\b(?:_?own_|(?:{'|'.join(DIALECT)})\b)")


def public(tree: ast.Module) -> Iterator[tuple[int, ast.AST]]:
    """Yield a module, and its public definitions and those of its public classes, each with its line."""
    yield 1, tree
    scopes: list[ast.AST] = [tree]
    while scopes:
        for node in ast.iter_child_nodes(scopes.pop()):
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith(
                "_"
            ):
                yield node.lineno, node
                if isinstance(node, ast.ClassDef):
                    scopes.append(node)


def names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the names that a module defines, with their lines: functions, classes, arguments, variables, attributes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.attr


def docstring_faults(text: str) -> list[str]:
    faults = []
    for line, node in public(ast.parse(text)):
        first, *_ = (ast.get_docstring(node) or "").split("\n\n")
        if not first:
            continue
        if OPENINGS.match(first):
            faults.append(f"line {line}: opens with {OPENINGS.match(first).group()!r}: {first}")
        if not first.rstrip().endswith("."):
            faults.append(f"line {line}: does not end with a period: {first}")
    return faults


def name_faults(text: str) -> list[str]:
    if not DISCOURAGED.search(text):  # most files, which are then not parsed
        return []
    computed = sorted(set(names(ast.parse(text))))
    faults = [f"line {line}: {name}; rather: {DIALECT[name]}" for line, name in computed if name in DIALECT]
    return faults + [f"line {line}: {name}: a possessive" for line, name in computed if re.match(r"_?own_", name)]


def ambiguity_faults(text: str) -> list[str]:
    if not re.search("|".join(AMBIGUOUS), text, re.IGNORECASE):
        return []
    return [
        f"line {line}: {name}; rather: {AMBIGUOUS[word]}"
        for line, name in sorted(set(names(ast.parse(text))))
        for word in name.lower().split("_")
        if word in AMBIGUOUS
    ]


def test_checks_detect_faults():
    assert docstring_faults('"""A module."""\ndef f():\n    """Whether it is."""') == [
        "line 2: opens with 'Whether': Whether it is."
    ]
    assert docstring_faults('class A:\n    def f(self):\n        """Return it"""')
    assert not docstring_faults('def _f():\n    """Of what"""\nclass A:\n    """Assemble it.\n\n    Of"""')
    assert name_faults("def f(own_gap):\n    self.tensed = 1\n    Rim = 2\n    return turned")
    assert not name_faults("def f(owner):\n    return restored")
    assert len(ambiguity_faults("def f(moved, *, own):\n    sides_reached: int = 1\n    UNREACHABLE = 2")) == 4
    assert not ambiguity_faults("def f(removed, owner):\n    return found")


def file_faults(check: Callable[[str], list[str]], files: list[Path] = FILES) -> str:
    faults = ((file.relative_to(ROOT), fault) for file in files for fault in check(file.read_text(encoding="utf-8")))
    return "\n".join(f"{file}, {fault}" for file, fault in faults)


def test_first_lines_are_sentences():
    faults = file_faults(docstring_faults)
    assert not faults, faults


def test_names_are_terms_of_the_field():
    faults = file_faults(name_faults)
    assert not faults, faults


def test_names_in_packages_have_one_meaning():
    faults = file_faults(ambiguity_faults, PACKAGE_FILES)
    assert not faults, faults
