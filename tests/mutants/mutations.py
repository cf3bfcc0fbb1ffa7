"""The faults that can be put into a source text."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
_SYMMETRIC = {"minimum", "maximum", "min", "max", "logaddexp", "hypot", "array_equal"}
_SILENT = {
    "strict",
    "slots",
    "frozen",
    "eq",
    "casting",
    "kind",
}  # keywords whose values change nothing that is computed


@dataclass(frozen=True, slots=True)
class Mutant:
    """Characters ``start`` to ``stop`` of a source (in bytes of UTF-8), and what takes their place."""

    kind: str
    line: int
    start: int
    stop: int
    text: str

    def apply(self, source: str) -> str:
        """The source with the fault."""
        data = source.encode()
        return (data[: self.start] + self.text.encode() + data[self.stop :]).decode()

    def change(self, source: str) -> tuple[str, str]:
        """The lines that it changes, before and after, each as one line."""
        data = source.encode()
        begin, end = data.rfind(b"\n", 0, self.start) + 1, data.find(b"\n", self.stop)
        old = data[begin:end].decode()
        new = (data[begin : self.start] + self.text.encode() + data[self.stop : end]).decode()
        return " ".join(old.split()), " ".join(new.split())


class _Fault(NamedTuple):
    kind: str
    node: ast.AST
    text: str


def mutants(source: str) -> list[Mutant]:
    """All mutants of a source, in the order of its text; each parses, and none changes texts, types or decorators."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for kind, node, text in _faults(ast.parse(source)):
        assert isinstance(node, ast.expr | ast.stmt)
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start, stop = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        found.append(Mutant(kind, node.lineno, start, stop, f"({text})" if isinstance(node, ast.expr) else text))
    return sorted(found, key=lambda m: (m.start, m.stop, m.text))


def _faults(node: ast.AST) -> Iterator[_Fault]:
    for child in _children(node):
        yield from _of_statement(child)
        yield from _of_expression(child)
        yield from _faults(child)


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """Parts of a node in which a fault can change what is computed."""
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "type_params", "msg", "bases"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.JoinedStr | ast.Import):
                continue
            if isinstance(child, ast.keyword) and child.arg in _SILENT:
                continue
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            yield child


def _of_statement(node: ast.AST) -> Iterator[_Fault]:
    if isinstance(node, ast.Return) and node.value is not None and not isinstance(node.value, ast.Constant):
        yield _Fault("return value", node, "return None")
    dropped = isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))
    if dropped or (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript | ast.Attribute)):
        yield _Fault("dropped", node, "pass")
    if isinstance(node, ast.AugAssign) and type(node.op) in _ARITHMETIC:
        operator = _ARITHMETIC[type(node.op)]()
        yield _Fault("arithmetic", node, ast.unparse(ast.AugAssign(node.target, operator, node.value)))
    if isinstance(node, ast.If | ast.While | ast.IfExp | ast.comprehension):
        for test in node.ifs if isinstance(node, ast.comprehension) else [node.test]:
            yield _Fault("condition", test, f"not ({ast.unparse(test)})")


def _of_expression(node: ast.AST) -> Iterator[_Fault]:
    if isinstance(node, ast.Compare):
        for i, operator in enumerate(node.ops):
            for other in _COMPARISONS[type(operator)]:
                ops = [*node.ops[:i], other(), *node.ops[i + 1 :]]
                yield _Fault("comparison", node, ast.unparse(ast.Compare(node.left, ops, node.comparators)))
    elif isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        yield _Fault("arithmetic", node, ast.unparse(ast.BinOp(node.left, _ARITHMETIC[type(node.op)](), node.right)))
    elif isinstance(node, ast.BoolOp):
        other_op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield _Fault("and/or", node, ast.unparse(ast.BoolOp(other_op, node.values)))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub | ast.Invert):
        yield _Fault("sign", node, ast.unparse(node.operand))
    else:
        yield from _of_constant(node)
        yield from _of_call(node)


def _of_constant(node: ast.AST) -> Iterator[_Fault]:
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield _Fault("constant", node, repr(not node.value))
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        for value in {node.value + 1, node.value - 1, node.value * 2} - {node.value}:
            yield _Fault("constant", node, repr(value))


def _of_call(node: ast.AST) -> Iterator[_Fault]:
    if isinstance(node, ast.Call) and len(node.args) > 1:
        first, second, *rest = node.args
        same = ast.dump(first) == ast.dump(second) or ast.unparse(node.func).rpartition(".")[2] in _SYMMETRIC
        if not same and not any(isinstance(a, ast.Starred) for a in (first, second)):
            yield _Fault("swapped", node, ast.unparse(ast.Call(node.func, [second, first, *rest], node.keywords)))
