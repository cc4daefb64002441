"""Edits of Python and C sources that introduce faults: operators, constants, statements."""

import ast
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Edit:
    """A replacement of bytes of a source.

    Attributes
    ----------
    kind : str
        comparison, arithmetic, logic, shift, constant, condition, deleted or returned.
    start, end : int
        The replaced bytes are start..end - 1.
    new : str
    """

    kind: str
    start: int
    end: int
    new: str


COMPARISONS: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: (r"\bis\b", ("is not",)),
    ast.IsNot: (r"\bis\s+not\b", ("is",)),
    ast.In: (r"\bin\b", ("not in",)),
    ast.NotIn: (r"\bnot\s+in\b", ("in",)),
}
ARITHMETIC: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "//"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
}
RETURNED = {"bool": ("True", "False"), "int": ("0",), "float": ("0.0",), "str": ('""',)}
"""Replacement return values by annotation; None for all others."""


def python_edits(source: bytes) -> list[Edit]:
    """Return all edits of a Python module.

    Annotations, decorators, docstrings, format strings, assertions and arguments of exceptions are
    not edited: they have no effect except on messages.
    """
    visitor = _Visitor(source)
    visitor.visit(ast.parse(source))
    return visitor.edits


class _Visitor(ast.NodeVisitor):
    def __init__(self, source: bytes) -> None:
        self.source = source
        self.edits: list[Edit] = []
        self.returns = [""]
        self.line_starts = [0]
        for line in source.splitlines(keepends=True):
            self.line_starts.append(self.line_starts[-1] + len(line))

    def _span(self, node: ast.stmt | ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = self.line_starts[node.lineno - 1] + node.col_offset
        return start, self.line_starts[node.end_lineno - 1] + node.end_col_offset

    def _replace(self, kind: str, node: ast.stmt | ast.expr, *new: str) -> None:
        self.edits += [Edit(kind, *self._span(node), text) for text in new]

    def _replace_between(
        self, kind: str, left: ast.expr, right: ast.expr, old: str, *new: str
    ) -> None:
        """Replace the operator that matches the pattern `old`."""
        start, end = self._span(left)[1], self._span(right)[0]
        match = re.search(old.encode(), self.source[start:end])
        if match:
            span = start + match.start(), start + match.end()
            self.edits += [Edit(kind, *span, text) for text in new]

    def _negate(self, test: ast.expr) -> None:
        if ast.unparse(test) != "TYPE_CHECKING":
            start, end = self._span(test)
            text = self.source[start:end].decode()
            self.edits.append(Edit("condition", start, end, f"(not ({text}))"))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.returns.append(ast.unparse(node.returns) if node.returns else "")
        defaults = [default for default in (*node.args.defaults, *node.args.kw_defaults) if default]
        for child in [*defaults, *node.body]:
            self.visit(child)
        self.returns.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for child in node.body:
            self.visit(child)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_Assert(self, node: ast.Assert) -> None:
        return

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        return

    def visit_Raise(self, node: ast.Raise) -> None:
        self._replace("deleted", node, "pass")

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._replace("deleted", node, "pass")
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        if isinstance(node.targets[0], ast.Attribute | ast.Subscript):
            self._replace("deleted", node, "pass")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._replace("deleted", node, "pass")
        if type(node.op) in ARITHMETIC:
            old, new = (f"{operator}=" for operator in ARITHMETIC[type(node.op)])
            self._replace_between("arithmetic", node.target, node.value, re.escape(old), new)
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is not None and not isinstance(node.value, ast.Constant):
            self._replace("returned", node.value, *RETURNED.get(self.returns[-1], ("None",)))
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        terms = [node.left, *node.comparators]
        for left, right, operator in zip(terms[:-1], terms[1:], node.ops, strict=True):
            old, new = COMPARISONS[type(operator)]
            self._replace_between("comparison", left, right, old, *new)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        sides = (node.left, node.right)
        is_text = any(
            isinstance(side, ast.JoinedStr)
            or (isinstance(side, ast.Constant) and isinstance(side.value, str | bytes))
            for side in sides
        )
        if type(node.op) in ARITHMETIC and not is_text:
            old, new = ARITHMETIC[type(node.op)]
            self._replace_between("arithmetic", *sides, re.escape(old), new)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values[:-1], node.values[1:], strict=True):
            self._replace_between("logic", left, right, rf"\b{old}\b", new)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._replace("constant", node, str(not value))
        elif isinstance(value, int):
            self._replace("constant", node, str(value + 1), *([str(value - 1)] * (value > 0)))
        elif isinstance(value, float):
            self._replace("constant", node, repr(value * 2 or 1.0))


C_OPERATORS = {
    b"<": ("comparison", "<="),
    b"<=": ("comparison", "<"),
    b">": ("comparison", ">="),
    b">=": ("comparison", ">"),
    b"==": ("comparison", "!="),
    b"!=": ("comparison", "=="),
    b"&&": ("logic", "||"),
    b"||": ("logic", "&&"),
    b"&": ("logic", "|"),
    b"|": ("logic", "&"),
    b"+": ("arithmetic", "-"),
    b"-": ("arithmetic", "+"),
    b"+=": ("arithmetic", "-="),
    b"-=": ("arithmetic", "+="),
    b"<<": ("shift", ">>"),
    b">>": ("shift", "<<"),
}
NOT_CODE = re.compile(
    rb"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'|^[ \t]*#(?:\\\n|[^\n])*",
    re.DOTALL | re.MULTILINE,
)
C_TOKEN = re.compile(
    rb"[A-Za-z_]\w*|0[xX][0-9a-fA-F]*(?:\.[0-9a-fA-F]*)?(?:[pP][+-]?\d+)?\w*"
    rb"|\d+\.\d*(?:[eE][+-]?\d+)?\w*|\d+\w*"
    rb"|<<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/|&^%]=|[^\s\w]"
)
INTEGER = re.compile(rb"(\d+)([uUlL]*)$")


def c_edits(source: bytes) -> list[Edit]:
    """Return all edits of a C file; comments, strings and preprocessor lines are not edited."""
    code = NOT_CODE.sub(lambda found: re.sub(rb"[^\n]", b" ", found[0]), source)
    edits, before = [], b"("
    for result in C_TOKEN.finditer(code):
        token = result[0]
        is_value = before[-1:].isalnum() or before[-1:] in b"_)]"
        is_binary = is_value and before not in (b"return", b"case")
        if token in C_OPERATORS and is_binary:
            kind, new = C_OPERATORS[token]
            edits.append(Edit(kind, *result.span(), new))
        elif number := INTEGER.match(token):
            value, suffix = int(number[1]), number[2].decode()
            for other in (value + 1, abs(value - 1)):
                edits.append(Edit("constant", *result.span(), f"{other}{suffix}"))
        elif token == b"if":
            start = code.index(b"(", result.end())
            end = _end_of_parentheses(code, start)
            edits.append(Edit("condition", start, end, f"(!{source[start:end].decode()})"))
        before = token
    return edits


def _end_of_parentheses(code: bytes, start: int) -> int:
    depth = 0
    for at in range(start, len(code)):
        depth += {b"(": 1, b")": -1}.get(code[at : at + 1], 0)
        if depth == 0:
            return at + 1
    raise ValueError("a parenthesis is not closed")
