"""Formulas typed into a scene: arithmetic on named variables, their values and exact derivatives.

The text is parsed with `ast` and only a short list of nodes is accepted, so a formula can compute and do
nothing else. Every number is a double and every operation one numpy call, so no big integers arise.
Derivatives come from forward-mode differentiation: each operation carries d/d(variable) beside its value,
exact up to rounding, never a difference.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.records import Value

MAX_LENGTH = 1000
MAX_DEPTH = 100

CONSTANTS = {"pi": np.pi, "e": np.e}
ALLOWED = "+ - * / ** ( ), numbers, pi, e and the functions"

_FOREIGN = re.compile(r"[^0-9A-Za-z_.+\-*/(), ]")
_GLUED = re.compile(r"(?<![\w.])(?>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?=[A-Za-z_])")


class Dual(Value):
    """A value and its derivatives; a variable that is missing in `slopes` has derivative 0."""

    value: NDArray[np.float64]
    slopes: Mapping[str, NDArray[np.float64]]


# function -> value, and one derivative per argument, each from the arguments and the value
_Parts: TypeAlias = tuple[Callable[..., Any], tuple[Callable[..., Any], ...]]

FUNCTIONS: dict[str, _Parts] = {
    "sin": (np.sin, (lambda a, f: np.cos(a),)),
    "cos": (np.cos, (lambda a, f: -np.sin(a),)),
    "tan": (np.tan, (lambda a, f: 1 + f * f,)),
    "sinh": (np.sinh, (lambda a, f: np.cosh(a),)),
    "cosh": (np.cosh, (lambda a, f: np.sinh(a),)),
    "tanh": (np.tanh, (lambda a, f: 1 / np.square(np.cosh(a)),)),
    "exp": (np.exp, (lambda a, f: f,)),
    "log": (np.log, (lambda a, f: 1 / a,)),
    "sqrt": (np.sqrt, (lambda a, f: 0.5 / f,)),
    "abs": (np.abs, (lambda a, f: np.sign(a),)),
    "atan2": (np.arctan2, (lambda a, b, f: b / (a * a + b * b), lambda a, b, f: -a / (a * a + b * b))),
    "mod": (np.mod, (lambda a, b, f: 1.0, lambda a, b, f: -np.floor(a / b))),
    "min": (np.minimum, (lambda a, b, f: a <= b, lambda a, b, f: a > b)),
    "max": (np.maximum, (lambda a, b, f: a >= b, lambda a, b, f: a < b)),
}

_BINARY: dict[type[ast.operator], _Parts] = {
    ast.Add: (np.add, (lambda a, b, f: 1.0, lambda a, b, f: 1.0)),
    ast.Sub: (np.subtract, (lambda a, b, f: 1.0, lambda a, b, f: -1.0)),
    ast.Mult: (np.multiply, (lambda a, b, f: b, lambda a, b, f: a)),
    ast.Div: (np.divide, (lambda a, b, f: 1 / b, lambda a, b, f: -f / b)),
    # b * a**(b - 1), with 0 where b is 0 even at a = 0
    ast.Pow: (
        np.power,
        (
            lambda a, b, f: np.where(b == 0, 0.0, b * np.power(a, b - 1)),
            lambda a, b, f: f * np.log(a),
        ),
    ),
}

_UNARY: dict[type[ast.unaryop], _Parts] = {
    ast.USub: (np.negative, (lambda a, f: -1.0,)),
    ast.UAdd: (np.positive, (lambda a, f: 1.0,)),
}


class Formula(Value):
    """A formula of the given variables that `parse` has checked."""

    text: str
    variables: tuple[str, ...]
    tree: ast.expr
    names: frozenset[str]
    """The variables that occur in it."""

    def value(self, *values: ArrayLike) -> NDArray[np.float64]:
        """The formula at the values of its variables, float64 in their common shape.

        Outside its domain (log(-1), 1/0) it is NaN or infinite, without a warning.
        """
        arrays = [np.asarray(value, np.float64) for value in values]
        scope = {name: Dual(array, {}) for name, array in zip(self.variables, arrays, strict=True)}
        with np.errstate(all="ignore"):
            return _full(_evaluate(self.tree, scope).value, np.broadcast_shapes(*(a.shape for a in arrays)))

    def gradient(self, *values: ArrayLike) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
        """The value, and its derivative by each variable, in order; float64 in the values' common shape."""
        arrays = [np.asarray(value, np.float64) for value in values]
        one = np.ones(())
        scope = {name: Dual(a, {name: one}) for name, a in zip(self.variables, arrays, strict=True)}
        with np.errstate(all="ignore"):
            result = _evaluate(self.tree, scope)
            slopes = [result.slopes.get(name, np.zeros(())) for name in self.variables]
        shape = np.broadcast_shapes(*(a.shape for a in arrays))
        return _full(result.value, shape), [_full(slope, shape) for slope in slopes]


def parse(text: str, variables: tuple[str, ...]) -> Formula:
    """The formula in `text` over `variables`.

    Raises
    ------
    ValueError
        Anything but + - * / **, parentheses, numbers, the variables, pi, e and the functions above; too
        long or too deep. The message names the position, counted from 1.
    """
    if len(text) > MAX_LENGTH:
        raise ValueError(f"formula has {len(text)} characters, at most {MAX_LENGTH} are allowed")
    # Characters and glued names that Python's own parser would explain badly.
    line = re.sub(r"\s", " ", text)
    if foreign := _FOREIGN.search(line):
        hint = (
            "; a power is written **"
            if foreign[0] == "^"
            else f"; there are {ALLOWED} {', '.join(FUNCTIONS)}"
        )
        raise _refusal(foreign.start(), f"'{foreign[0]}' is not part of a formula{hint}")
    if glued := _GLUED.search(line):
        raise _refusal(
            glued.end(), f"'{line[glued.end()]}' follows the number {glued[0]}; a product is written *"
        )

    # The expression tree, of accepted nodes only.
    indent = len(line) - len(line.lstrip())
    try:
        tree = ast.parse(line.strip(), mode="eval").body
    except SyntaxError as error:
        raise _refusal((error.offset or 1) - 1 + indent, f"not a formula: {error.msg}") from None
    except (RecursionError, MemoryError):
        raise ValueError("formula is nested too deeply") from None
    _check(tree, variables, indent, 1)
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return Formula(text, variables, tree, frozenset(names.intersection(variables)))


def checked(text: str, variables: tuple[str, ...]) -> str:
    """The text itself, if `parse` accepts it; for fields of a scene."""
    parse(text, variables)
    return text


def _full(values: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    return np.array(np.broadcast_to(values, shape), np.float64)


def _refusal(place: int, fact: str) -> ValueError:
    return ValueError(f"position {place + 1}: {fact}")


def _advice(name: str, known: tuple[str, ...]) -> str:
    """The known name that is most similar, or all."""
    from difflib import get_close_matches

    near = get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(known)}"


def _chain(node: ast.expr) -> tuple[ast.expr, list[ast.BinOp]]:
    """The first operand of `a + b * c - d`, here a, and the operations on it in order, + and -.

    A sum of N terms is a tree N deep, though nothing in it is nested.
    """
    operations = []
    while isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        operations.append(node)
        node = node.left
    return node, operations[::-1]


def _check(node: ast.expr, variables: tuple[str, ...], indent: int, depth: int) -> None:
    """Raise ValueError if `node`, or anything below it, is not on the list of accepted nodes."""
    # Limit the depth of nesting.
    node, operations = _chain(node)
    place = node.col_offset + indent
    if depth > MAX_DEPTH:
        raise _refusal(place, f"nested more than {MAX_DEPTH} deep")

    # Check the node by its type: a number, a name, a sign or a function.
    parts: list[ast.expr]
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            if number > sys.float_info.max:
                raise _refusal(place, "number too large for a double")
            parts = []
        case ast.Name(id=name):
            if name not in variables and name not in CONSTANTS:
                known = (*variables, *CONSTANTS)
                raise _refusal(place, f"unknown name '{name}'; {_advice(name, known)}")
            parts = []
        case ast.UnaryOp() if type(node.op) in _UNARY:
            parts = [node.operand]
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            if name not in FUNCTIONS:
                raise _refusal(place, f"unknown function '{name}'; there are: {', '.join(FUNCTIONS)}")
            wanted = len(FUNCTIONS[name][1])
            if len(args) != wanted:
                raise _refusal(place, f"{name} takes {wanted} argument{'s' * (wanted > 1)}, got {len(args)}")
            parts = args
        case _:
            raise _refusal(place, f"not part of a formula; there are {ALLOWED} {', '.join(FUNCTIONS)}")

    # Check its operand or arguments, and what it is combined with.
    for part in (*parts, *(each.right for each in operations)):
        _check(part, variables, indent, depth + 1)


def _evaluate(node: ast.expr, scope: Mapping[str, Dual]) -> Dual:
    first, operations = _chain(node)
    result = _operand(first, scope)
    for each in operations:
        result = _apply(_BINARY[type(each.op)], [result, _evaluate(each.right, scope)])
    return result


def _operand(node: ast.expr, scope: Mapping[str, Dual]) -> Dual:
    """The value of a node that is no operation on two."""
    match node:
        case ast.Constant(value=number):
            return Dual(np.asarray(number, np.float64), {})
        case ast.Name(id=name):
            return scope[name] if name in scope else Dual(np.asarray(CONSTANTS[name]), {})
        case ast.UnaryOp():
            parts, arguments = _UNARY[type(node.op)], [node.operand]
        case ast.Call(func=ast.Name(id=name)):
            parts, arguments = FUNCTIONS[name], node.args
        case _:
            raise TypeError(f"not checked: {node}")
    return _apply(parts, [_evaluate(argument, scope) for argument in arguments])


def _apply(parts: _Parts, arguments: list[Dual]) -> Dual:
    """The chain rule: value f(a, b), slope df/da a' + df/db b'."""
    function, derivatives = parts
    values = [argument.value for argument in arguments]
    value = function(*values)
    slopes: dict[str, Any] = {}
    for argument, derivative in zip(arguments, derivatives, strict=True):
        if argument.slopes:
            outer = derivative(*values, value)
            for name, inner in argument.slopes.items():
                slopes[name] = slopes[name] + outer * inner if name in slopes else outer * inner
    return Dual(value, slopes)
