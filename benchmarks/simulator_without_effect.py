"""A copy of the simulator that never had an effect, to compare the cost of the real one with.

The compiled functions test whether an effect is absent by ``name is None``. In the copy the result
is written into the source, and code that cannot be reached is removed: nothing of the effect is
left for the compiler to prune.
"""

import ast
import shutil
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "sim_core"
COMPILERS = {"jit", "inlined"}


class _Without(ast.NodeTransformer):
    """Writes True for ``NAME is None``, and removes what that makes unreachable."""

    def __init__(self, names: frozenset[str]) -> None:
        self.names = names
        self.answers = 0

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        left = node.left
        name = left.attr if isinstance(left, ast.Attribute) else getattr(left, "id", "")
        none = isinstance(node.comparators[0], ast.Constant) and node.comparators[0].value is None
        if name not in self.names or not none or not isinstance(node.ops[0], (ast.Is, ast.IsNot)):
            return node
        self.answers += 1
        return ast.Constant(isinstance(node.ops[0], ast.Is))

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        decides = isinstance(node.op, ast.Or)
        values = [value for value in node.values if _constant(value) is not (not decides)]
        for place, value in enumerate(values):
            if _constant(value) is decides:
                values = values[: place + 1]
                break
        if not values:
            return ast.Constant(not decides)
        return values[0] if len(values) == 1 else ast.BoolOp(node.op, values)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        answer = _constant(node.test)
        return node if answer is None else node.body if answer else node.orelse

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        answer = _constant(node.test)
        return node if answer is None else node.body if answer else node.orelse

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if not any(getattr(decorator, "id", "") in COMPILERS for decorator in node.decorator_list):
            return node
        self.generic_visit(node)
        for place, statement in enumerate(node.body):
            if isinstance(statement, ast.Return):
                del node.body[place + 1 :]
                break
        return node


def _constant(node: ast.expr) -> bool | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, bool) else None


def never_had(names: tuple[str, ...], folder: Path) -> Path:
    """Write a copy of sim_core without an effect.

    Args:
        names: of the effect in compiled code.
        folder: for the copy.

    Returns:
        The folder, for the module search path.

    Raises:
        ValueError: if no compiled function has these names.
    """
    copy = folder / "sim_core"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    answers = 0
    for path in copy.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        without = _Without(frozenset(names))
        changed = ast.fix_missing_locations(without.visit(tree))
        if without.answers:
            path.write_text(ast.unparse(changed), encoding="utf-8")
            answers += without.answers
    if answers == 0:
        raise ValueError(f"no compiled function tests whether {names} is None")
    return folder
