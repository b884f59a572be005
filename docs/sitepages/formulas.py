"""Formulas as docstrings have them, in MathML, which browsers show without a script.

A formula is what a programmer types: `rho / pi * (1 + r s / t)`, `n_h**e`, `tan^2(theta)`. A space
multiplies, and a name that touches its parenthesis is a function.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from typing import NamedTuple

GREEK = {
    "alpha": "α", "beta": "β", "theta": "θ", "phi": "φ", "psi": "ψ", "rho": "ρ", "sigma": "σ", "tau": "τ",
    "pi": "π", "Lambda": "Λ",
}  # fmt: skip
FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "ln", "max", "min")
COSINE = re.compile(r"([nvrl])_([lvhsw])")
"""Names that are dot products: n_l reads "n dot l"."""
WORDS = ("where", "or", "otherwise")
"""Words between formulas."""
ENDS = (*WORDS, "over", "of")
"""Words that are no names."""
TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<number>\d+(?:\.\d+)?)|(?P<name>[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)*'?)"
    r"|(?P<sign>\*\*|\.\.|<=|>=|[-+*/^=<>()|,.;])"
)


class FormulaError(ValueError):
    """A text is no formula."""


class Token(NamedTuple):
    """A number, a name or a sign."""

    kind: str
    text: str
    spaced: bool
    """Is there a space before it?"""


class Row(NamedTuple):
    """A formula, and the words beside it."""

    left: str
    right: str
    remark: str


def mathml(paragraph: str) -> str:
    """The formulas of a paragraph, one below the other.

    Raises
    ------
    FormulaError
        The paragraph is none of formulas.
    """
    rows = [
        f"<mtr><mtd>{_math(row.left)}</mtd><mtd><mo>=</mo>{_math(row.right)}</mtd>"
        f"<mtd><mtext>{escape(row.remark)}</mtext></mtd></mtr>"
        for row in _rows(paragraph)
    ]
    return f'<div class="formula"><math display="block"><mtable>{"".join(rows)}</mtable></math></div>'


def _rows(paragraph: str) -> Iterator[Row]:
    """The formulas of a paragraph: a line has one or several, and may go on in the next."""
    lines: list[str] = []
    for line in paragraph.splitlines():
        if lines and re.match(r"\s+[^\s=]", line):
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    for line in lines:
        formula, _, remark = re.sub(r"^(\S+)\s+=", r"\1 =", line).partition("   ")
        for each in re.split(r"[,;]\s\s", formula):
            left, equals, right = each.partition("= ")
            if not equals or re.search(r"\w \w", left):
                raise FormulaError(each)
            # `C1 = A = 1 - ...`
            yield Row(left.strip(), right, remark.strip())


def _math(text: str) -> str:
    return _Parser(text).whole() if text else ""


def _tokens(text: str) -> list[Token]:
    tokens: list[Token] = []
    place, spaced = 0, False
    while place < len(text):
        match = TOKEN.match(text, place)
        if not match:
            raise FormulaError(text)
        place = match.end()
        if match.lastgroup != "space":
            tokens.append(Token(str(match.lastgroup), match[0], spaced))
        spaced = match.lastgroup == "space"
    return tokens


class _Parser:
    """From tokens to MathML by precedence: relations, sums, products, powers."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._rest = _tokens(text)

    def whole(self) -> str:
        """All of the text."""
        parts = [self._sum()]
        while token := self._next():
            if token.text in WORDS:
                parts.append(f"<mtext>&#xA0;{token.text}&#xA0;</mtext>")
            elif token.text in ("=", "<", ">", "<=", ">=", ",", ";", ".."):
                parts.append(
                    f"<mo>{escape({'<=': '≤', '>=': '≥', '..': '…'}.get(token.text, token.text))}</mo>"
                )
            else:
                raise FormulaError(self._text)
            if self._peek() and self._peek().text not in WORDS:
                parts.append(self._sum())
        return "".join(parts)

    def _peek(self, ahead: int = 0) -> Token | None:
        return self._rest[ahead] if ahead < len(self._rest) else None

    def _next(self) -> Token | None:
        return self._rest.pop(0) if self._rest else None

    def _take(self, text: str) -> None:
        token = self._next()
        if token is None or token.text != text:
            raise FormulaError(f"{self._text}: {text} is missing")

    def _is(self, *texts: str) -> bool:
        token = self._peek()
        return token is not None and token.text in texts

    def _sum(self) -> str:
        parts = []
        if self._is("-", "+"):
            parts.append(f"<mo>{'−' if self._next().text == '-' else '+'}</mo>")  # type: ignore[union-attr]
        parts.append(self._product())
        while self._is("+", "-"):
            parts.append(f"<mo>{'−' if self._next().text == '-' else '+'}</mo>")  # type: ignore[union-attr]
            parts.append(self._product())
        if self._is("over"):  # what a sum is over, in words
            words = []
            while (token := self._peek()) and token.kind == "name":
                words.append(self._rest.pop(0).text)
            parts.append(f"<mtext>&#xA0;{' '.join(words)}</mtext>")
        return f"<mrow>{''.join(parts)}</mrow>"

    def _product(self) -> str:
        """Factors side by side. Above the line of a fraction are those since the last sign, one is below."""
        done: list[str] = []
        run = [self._power()]
        while True:
            if self._is("*"):
                self._next()
                done, run = [*done, *run], [self._power()]
            elif self._is("/"):
                self._next()
                above = _bare(run[0]) if len(run) == 1 else _side_by_side(run)
                run = [f"<mfrac>{_row(above)}{_row(_bare(self._power()))}</mfrac>"]
                done, run = [*done, *run], []
            elif self._starts_factor():
                run.append(self._power())
            else:
                return _side_by_side([*done, *run])

    def _starts_factor(self) -> bool:
        token = self._peek()
        if token is None or token.text in ENDS:
            return False
        if token.text == "<":  # an average, not a relation
            after = self._peek(1)
            return after is not None and not after.spaced
        return token.kind in ("number", "name") or (token.text in ("(", "|") and self._opens(token))

    def _opens(self, token: Token) -> bool:
        """Does a bar begin a magnitude? One that ends it touches what is before it."""
        return token.text != "|" or token.spaced

    def _power(self) -> str:
        base = self._atom()
        if self._is("^", "**"):
            self._next()
            sign = "<mo>−</mo>" if self._is("-") and self._next() else ""
            return f"<msup>{_row(base)}{_row(sign + _bare(self._atom()))}</msup>"
        return base

    def _atom(self) -> str:
        token = self._next()
        if token is None:
            raise FormulaError(self._text)
        if token.kind == "number":
            return f"<mn>{token.text}</mn>"
        if token.text == "(":
            return self._closed(")", "(", ")")
        if token.text == "|":
            return self._closed("|", "|", "|")
        if token.text == "<":
            return self._closed(">", "⟨", "⟩")
        if token.kind == "name":
            return self._named(token.text)
        raise FormulaError(self._text)

    def _closed(self, end: str, left: str, right: str) -> str:
        parts = [self._sum()]
        while self._is(","):
            self._next()
            parts.append(self._sum())
        self._take(end)
        inside = "<mo>,</mo>".join(parts)
        return f"<mrow><mo>{left}</mo>{inside}<mo>{right}</mo></mrow>"

    def _named(self, name: str) -> str:
        if self._is("."):  # a dot product
            self._next()
            other = self._next()
            if other is None or other.kind != "name":
                raise FormulaError(self._text)
            return f"<mrow>{_vector(name)}<mo>⋅</mo>{_vector(other.text)}</mrow>"
        if self._is("x") and self._peek().spaced and (after := self._peek(1)) and after.kind == "name":  # type: ignore[union-attr]
            self._next()
            return f"<mrow>{_vector(name)}<mo>×</mo>{_vector(self._next().text)}</mrow>"  # type: ignore[union-attr]
        if name == "sqrt":
            self._take("(")
            return f"<msqrt>{_bare(self._closed(')', '(', ')'))}</msqrt>"
        if name == "integral":
            return self._integral()
        if name == "sum":
            self._take("of")
            return "<mo>∑</mo>"
        symbol = _symbol(name)
        if name in FUNCTIONS and self._is("^"):  # tan^2(theta)
            self._next()
            symbol = f"<msup>{symbol}{_row(self._atom())}</msup>"
        after = self._peek()
        if after is not None and after.text == "(" and (not after.spaced or name in FUNCTIONS):
            self._next()
            return f"<mrow>{symbol}{self._closed(')', '(', ')')}</mrow>"
        return symbol

    def _integral(self) -> str:
        sign = "<mo>∫</mo>"
        if self._is("over"):
            self._next()
            low = self._sum()
            self._take("..")
            sign = f"<msubsup><mo>∫</mo>{low}{self._sum()}</msubsup>"
        self._take("of")
        return f"<mrow>{sign}</mrow>"


def _side_by_side(factors: list[str]) -> str:
    return '<mspace width="0.17em"/>'.join(factors)


def _row(inside: str) -> str:
    return f"<mrow>{inside}</mrow>"


def _bare(inside: str) -> str:
    """Without the parentheses that a fraction or an exponent makes needless."""
    match = re.fullmatch(r"<mrow><mo>\(</mo>(.*)<mo>\)</mo></mrow>", inside)
    return match[1] if match and _balanced(match[1]) else inside


def _balanced(inside: str) -> bool:
    depth = 0
    for each in re.findall(r"<mo>([()])</mo>", inside):
        depth += 1 if each == "(" else -1
        if depth < 0:
            return False
    return depth == 0


def _vector(name: str) -> str:
    first, _, rest = name.partition("_")
    bold = f'<mi mathvariant="normal" class="vector">{first}</mi>'
    return f"<msub>{bold}{_symbol(rest)}</msub>" if rest else bold


def _symbol(name: str) -> str:
    """A name: Greek letters, subscripts, words upright."""
    if match := COSINE.fullmatch(name):
        return f"<mrow><mo>(</mo>{_vector(match[1])}<mo>⋅</mo>{_vector(match[2])}<mo>)</mo></mrow>"
    if name.endswith("'"):
        return f"<msup>{_symbol(name[:-1])}<mo>′</mo></msup>"
    first, _, rest = name.partition("_")
    if not rest and re.fullmatch(r"[A-Za-z][a-z0-9]", name) and name not in (*GREEK, *FUNCTIONS):
        first, rest = name
    if rest:
        return f"<msub>{_letter(first)}{_letter(rest.replace('_', ' '))}</msub>"
    return _letter(first)


def _letter(name: str) -> str:
    return f"<mn>{name}</mn>" if name.isdigit() else f"<mi>{GREEK.get(name, name)}</mi>"
