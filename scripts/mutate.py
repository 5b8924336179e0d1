#!/usr/bin/env python
"""Mutation testing: changes one place of the code at a time and looks whether a test notices.

    scripts/mutate.py [MODULE...] [--sample N] [--seed S]

Modules and their tests are in tests/mutation.toml. Works on a copy of the tracked files. Needs `cosmic-ray`,
whose operators make the mutants, beside the `test` extra.

Each mutant is tested in a fork of one process that has imported what the tests import from elsewhere, so
that NumPy, SciPy, pymavlink and pytest load once. Compiled kernels need nothing else: the key of a kernel's
machine code has its bytecode, so a mutant is compiled anew, and the original is found in the cache.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import difflib
import importlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.plugins import get_operator, operator_names
from hypothesis import Phase, settings
from parso.python.tree import Keyword

OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|FloorDiv_Mul|Mod_Mul|Pow_Mul|BitAnd_BitOr"
    r"|BitOr_BitAnd|BitXor_BitOr|LShift_RShift|RShift_LShift)"
    r"|ReplaceComparisonOperator_(Eq_NotEq|NotEq_Eq|Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_GtE|GtE_Lt|Gt_LtE|LtE_Gt"
    r"|Is_IsNot|IsNot_Is)"
    r"|ReplaceUnaryOperator_Delete_(USub|Not)|AddNot|ReplaceTrueWithFalse|ReplaceFalseWithTrue"
    r"|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceBreakWithContinue|ReplaceContinueWithBreak|NumberReplacer"
    r"|ZeroIterationForLoop)"
)
"""No operator that only makes what no type checker would let pass, as `+` to `|`."""
ENTRY = ("where", "before", "after")
DIFF_CONTEXT = 2
SPARE_TIME = 30.0
"""s that a mutant may take beyond three times the tests' own time, before it counts as killed"""


class RemoveStatement(Operator):  # type: ignore[misc]
    """Leaves out a statement of a function or class: an assignment, a call, a return, a raise."""

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        if node.type != "simple_stmt" or node.children[0].type in ("import_name", "import_from", "pass_stmt"):
            return
        if node.children[0].type == "string" or node.parent.type == "file_input":
            return
        is_declaration = (
            node.children[0].type == "expr_stmt" and node.children[0].children[1].type == "annassign"
        )
        if is_declaration and len(node.children[0].children[1].children) == 2:
            return
        yield (node.start_pos, node.end_pos)

    def mutate(self, node: Any, index: int) -> Any:
        first = node.get_first_leaf()
        node.children = [Keyword("pass", first.start_pos, first.prefix), node.children[-1]]
        return node

    @classmethod
    def examples(cls) -> Any:
        return ()


class Mutant(NamedTuple):
    """One change of one file."""

    file: str
    before: str
    after: str

    def diff(self) -> str:
        """Unified, with little around it."""
        lines = (text.splitlines() for text in (self.before, self.after))
        return "\n".join([*difflib.unified_diff(*lines, self.file, self.file, "", "", DIFF_CONTEXT, "")][1:])

    def entry(self) -> dict[str, str]:
        """Function and changed line as they are named in tests/mutation.toml."""
        before, after = self.before.splitlines(), self.after.splitlines()
        first = next(i for i, (one, other) in enumerate(zip(before, after, strict=False)) if one != other)
        return {
            "where": _function_at(ast.parse(self.before), first + 1),
            "before": before[first].strip(),
            "after": after[first].strip(),
        }


def _function_at(tree: ast.AST, line: int) -> str:
    """Name of the innermost function or class around a line; empty if there is none."""
    name = ""
    for node in ast.walk(tree):  # outer ones come first
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.lineno <= line <= (node.end_lineno or 0):
            name = node.name
    return name


def mutants(root: Path, files: list[str], sample: int, seed: int) -> Iterator[Mutant]:
    """So many mutants of these files, drawn by the seed; all of them if `sample` is 0."""
    places = [(file, *place) for file in files for place in _places((root / file).read_text())]
    random.Random(seed).shuffle(places)
    made = 0
    for file, operator, occurrence in places:
        before = (root / file).read_text()
        after = mutate_code(before, operator, occurrence)
        if after is not None and _meaning(after) not in ("", _meaning(before)):
            yield Mutant(file, before, after)
            made += 1
            if made == sample:
                return


def _places(source: str) -> Iterator[tuple[Operator, int]]:
    """Every operator with the number of each place that it can mutate."""
    nodes = list(ast_nodes(get_ast(source)))
    names = sorted(name for name in operator_names() if OPERATORS.fullmatch(name))
    for operator in [*(get_operator(name)() for name in names), RemoveStatement()]:
        for occurrence in range(sum(len(list(operator.mutation_positions(node))) for node in nodes)):
            yield operator, occurrence


class _WithoutAnnotations(ast.NodeTransformer):
    def visit_arg(self, node: ast.arg) -> ast.arg:
        node.annotation = None
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)


def _meaning(source: str) -> str:
    """What differs for two sources that do not do the same; annotations do nothing. Empty: no Python."""
    try:
        return ast.dump(_WithoutAnnotations().visit(ast.parse(source)))
    except SyntaxError:
        return ""


class Tests:
    """Test files, run in forks of this process in a copy of the repository."""

    def __init__(self, root: Path, paths: list[str], log: Path) -> None:
        self._root, self._paths, self._log = root, paths, log
        self._timeout = 1800.0
        began = time.monotonic()
        if not self.pass_(warm=True):
            raise SystemExit(f"the tests fail without a mutant:\n{log.read_text()[-3000:]}")
        self._preload()
        began = time.monotonic()
        if not self.pass_():
            raise SystemExit(f"the tests fail without a mutant:\n{log.read_text()[-3000:]}")
        self.duration = time.monotonic() - began
        self._timeout = 3 * self.duration + SPARE_TIME

    def _preload(self) -> None:
        """Import into this process what the tests have imported from outside of the repository."""
        for name in (self._root / "imported").read_text().split():
            with contextlib.suppress(Exception):
                importlib.import_module(name)

    def pass_(self, warm: bool = False) -> bool:
        """Run them until the first fails."""
        child = os.fork()
        if child == 0:
            self._run(warm)
        deadline = time.monotonic() + self._timeout
        while time.monotonic() < deadline:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                self._end(child)
                return os.waitstatus_to_exitcode(status) == 0
            time.sleep(0.02)
        self._end(child)
        os.waitpid(child, 0)
        return False

    def _end(self, child: int) -> None:
        """End the fork's process group, itself and what it started."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child, signal.SIGKILL)

    def _run(self, warm: bool) -> None:
        os.setsid()
        out = os.open(self._log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        os.chdir(self._root)
        sys.path.insert(0, str(self._root))
        os.environ["PYTHONPATH"] = str(self._root)
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
        sys.dont_write_bytecode = not warm
        if not warm:
            os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        # A failure is all there is to know of: its example need not be made smaller.
        settings.register_profile("no shrinking", phases=(Phase.explicit, Phase.generate))
        settings.load_profile("no shrinking")
        status = 1
        try:
            status = int(pytest.main(["-x", "-p", "no:cacheprovider", "-p", "no:xdist", *self._paths]))
            if warm:
                foreign = [
                    name
                    for name, module in list(sys.modules.items())
                    if not (getattr(module, "__file__", None) or "").startswith(str(self._root))
                    and name.partition(".")[0]
                    not in ("sitl", "sitl_bridge", "controller", "tests", "__main__")
                ]
                Path("imported").write_text("\n".join(foreign))
        finally:
            os._exit(status)


def put(root: Path, file: str, text: str) -> None:
    """Write a source file, and forget its bytecode."""
    path = root / file
    path.write_text(text)
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()


def copy_of_tracked_files(to: Path) -> None:
    """The repository as it stands on disk, without what git does not know."""
    top = subprocess.run(["git", "rev-parse", "--show-toplevel"], capture_output=True, text=True, check=True)
    source = Path(top.stdout.strip())
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=source, capture_output=True, text=True, check=True)
    for name in filter(None, listed.stdout.split("\0")):
        if (source / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source / name, to / name)


def examine(root: Path, name: str, module: dict[str, Any], sample: int, seed: int) -> str:
    """Mutate a module; returns its line of the table."""
    tests = Tests(root, module["tests"], root / "log")
    print(f"{name}: the tests take {tests.duration:.1f} s", flush=True)
    known = {tuple(entry[key] for key in ENTRY): entry["reason"] for entry in module.get("survivor", [])}
    survived, count = [], 0
    for mutant in mutants(root, module["files"], sample, seed):
        count += 1
        put(root, mutant.file, mutant.after)
        if tests.pass_():
            entry = mutant.entry()
            survived.append(known.get(tuple(entry[key] for key in ENTRY), ""))
            print(f"survived: {mutant.diff()}", flush=True)
            if survived[-1]:
                print(f"reason: {survived[-1]}\n", flush=True)
            else:
                lines = [
                    f"[[module.{name}.survivor]]",
                    *(f"{key} = {json.dumps(entry[key])}" for key in ENTRY),
                ]
                print("\n".join([*lines, 'reason = ""\n']), flush=True)
        put(root, mutant.file, mutant.before)
    killed = count - len(survived)
    share = 100 * killed / max(1, count)
    line = f"{name}: {count} mutants, {killed} killed ({share:.1f} %), {len(survived)} survived"
    return f"{line}, {survived.count('')} of them for no known reason"


def main() -> None:
    """Mutate and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="default: all of tests/mutation.toml")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="mutants a module, default all")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of the sample, default 1")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="mutate-") as folder:
        root = Path(folder)
        copy_of_tracked_files(root)
        table = tomllib.loads((root / "tests/mutation.toml").read_text())["module"]
        if unknown := set(options.modules) - set(table):
            parser.error(f"no such module: {', '.join(sorted(unknown))}; there are {', '.join(table)}")
        lines = [
            examine(root, name, table[name], options.sample, options.seed)
            for name in options.modules or table
        ]
    print("\n".join(lines))


if __name__ == "__main__":
    main()
