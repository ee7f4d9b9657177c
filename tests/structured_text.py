"""Structured Text run by itself: the subset that the exported block and the example keep to, one statement a line.

A program becomes Python; its function blocks are called as in a PLC, once a cycle, and a timer counts the time that the
caller says has passed.
"""

import re
from types import CodeType
from typing import Any

FUNCTIONS = {
    "SHL": lambda value, places: value << places,
    "SHR": lambda value, places: value >> places,
    "DINT_TO_DWORD": lambda value: value & 0xFFFFFFFF,
    "DWORD_TO_WORD": lambda value: value & 0xFFFF,
    "UINT_TO_BYTE": lambda value: value & 0xFF,
    **dict.fromkeys(
        ("BYTE_TO_WORD", "UINT_TO_WORD", "WORD_TO_UINT", "WORD_TO_DWORD", "DWORD_TO_UDINT", "UDINT_TO_DINT"), int
    ),
}
LIMITS = {"BYTE": 0xFF, "UINT": 0xFFFF, "WORD": 0xFFFF, "INT": 0x7FFF, "UDINT": 0xFFFFFFFF}
_ARRAY = re.compile(r"ARRAY\[\d+\.\.(\d+)\] OF (\w+)", re.IGNORECASE)


class Time:
    """Time since the last cycle, s."""

    def __init__(self, cycle: float) -> None:
        self.cycle = cycle


class Timer:
    """TON of IEC 61131-3."""

    def __init__(self, time: Time) -> None:
        self.Q, self._time, self._elapsed = False, time, 0.0

    def __call__(self, IN: bool, PT: float) -> None:
        self._elapsed = self._elapsed + self._time.cycle if IN else 0.0
        self.Q = IN and self._elapsed >= PT


class Members:
    """The members of a structure."""

    def __init__(self, **values: Any) -> None:
        self.__dict__.update(values)


class Instance:
    """A program or a function block with its variables, which are its attributes too."""

    def __init__(self, unit: "Unit", units: dict[str, "Unit"], time: Time) -> None:
        self.types = {name: kind for name, (kind, _) in unit.variables.items()}
        self.v = {name: unit.first_value(kind, first, units, time) for name, (kind, first) in unit.variables.items()}
        self._body = unit.body

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["v"][name]
        except KeyError:
            raise AttributeError(name) from None

    def __call__(self, **inputs: Any) -> None:
        self.v.update(inputs)
        exec(self._body, {**FUNCTIONS, "v": self.v})
        for name, value in self.v.items():
            limit = LIMITS.get(self.types[name])
            if limit is not None:
                values = value if isinstance(value, list) else [value]
                assert all(0 <= one <= limit for one in values), f"{name} = {value}"


class Unit:
    """A program organisation unit: declared variables and the body as Python."""

    def __init__(self, text: str, types: dict[str, str], structs: dict[str, dict[str, int]]) -> None:
        self._types, self._structs = types, structs
        self.variables: dict[str, tuple[str, str]] = {}
        self.body = self._compile(text)

    def first_value(self, kind: str, first: str, units: dict[str, "Unit"], time: Time) -> Any:
        """Return the value of a variable before the first cycle."""
        if kind in ("TON", "TON_TIME"):
            return Timer(time)
        if kind in self._structs:
            return Members(**self._structs[kind])
        if kind in units:
            return Instance(units[kind], units, time)
        array = _ARRAY.fullmatch(self._types.get(kind, kind))
        if array:
            return [0] * (int(array[1]) + 1)
        if kind == "TIME":
            return eval(expression(first or "T#0s"))
        return first == "TRUE" if kind == "BOOL" else int(first or 0)

    def _compile(self, text: str) -> CodeType:
        lines: list[str] = []
        depth = 0
        for line in filter(None, map(str.strip, text.splitlines())):
            found = re.fullmatch(r'(\w+) : "?([\w.\[\] ]+)"?(?: := ([\w#]+))?;', line)
            if found is not None and not lines:
                name, kind, first = found.groups()
                assert name not in self.variables, f"{name} is declared twice"
                self.variables[name] = (kind, first or "")
            elif not line.startswith(("VAR", "END_VAR", "{", "VERSION", "BEGIN")):
                depth = self._statement(line, lines, depth)
        assert depth == 0
        return compile("\n".join(lines) or "pass", "structured text", "exec")

    @staticmethod
    def _statement(line: str, lines: list[str], depth: int) -> int:
        """Add one statement and return how deep the next one stands."""
        if line in ("END_IF;", "END_FOR;"):
            return depth - 1
        if found := re.fullmatch(r"FOR (\w+) := (\d+) TO (\d+) DO", line):
            lines.append("    " * depth + f"for v['{found[1]}'] in range({found[2]}, {found[3]} + 1):")
            return depth + 1
        if found := re.fullmatch(r"(IF|ELSIF) (.*) THEN", line):
            is_first = found[1] == "IF"
            word = "if" if is_first else "elif"
            lines.append("    " * (depth - (not is_first)) + f"{word} {expression(found[2])}:")
            return depth + is_first
        if line == "ELSE":
            lines.append("    " * (depth - 1) + "else:")
        elif found := re.fullmatch(r"(\w+)\((\w+ := .*)\);", line):
            given = [each.split(" := ", 1) for each in re.split(r", (?=\w+ := )", found[2])]
            inputs = ", ".join(f"{name}={expression(value)}" for name, value in given)
            lines.append("    " * depth + f"v['{found[1]}']({inputs})")
        else:
            assignment = re.fullmatch(r"(.+?) := (.+);", line)
            assert assignment, f"not understood: {line}"
            value = expression(assignment[2])
            copied = f"list({value})" if re.fullmatch(r"v\['\w+'\]\.(Command|Report)", value) else value
            lines.append("    " * depth + f"{expression(assignment[1])} = {copied}")
        return depth


def expression(text: str) -> str:
    """Return an expression in Python; times are in s."""
    text = re.sub(r"T#(\d+)(ms|s)", lambda found: str(int(found[1]) / (1000 if found[2] == "ms" else 1)), text)
    text = re.sub(r"16#([0-9A-F]+)", r"0x\1", text)
    is_bitwise = "DWORD" in text or "SHL" in text
    words = {"AND": "&" if is_bitwise else "and", "OR": "|" if is_bitwise else "or", "NOT": "not", "MOD": "%"}
    text = re.sub(r"\b(AND|OR|NOT|MOD)\b", lambda found: words[found[0]], text)
    text = re.sub(r"(?<![<>:])=", "==", text).replace("<>", "!=").replace("/", "//")
    names = {*words.values(), *FUNCTIONS, "TRUE", "FALSE"}
    text = re.sub(r"(?<![.\w])[A-Za-z]\w*\b", lambda found: found[0] if found[0] in names else f"v['{found[0]}']", text)
    return text.replace("TRUE", "True").replace("FALSE", "False")


def units_of(text: str) -> dict[str, Unit]:
    """Return every function block and program of a source, in Structured Text or SCL."""
    text = re.sub(r"\(\*.*?\*\)|//[^\n]*", "", text.replace("\r\n", "\n"), flags=re.DOTALL)
    text = re.sub(r"(?<![T6])#", "", text)
    types = dict(re.findall(r"(\w+) : (ARRAY\[.*\] OF \w+);", text))
    structs = {
        name: {member: int(first or 0) for member, first in re.findall(r"(\w+) : \w+(?: := (\d+))?;", members)}
        for name, members in re.findall(
            r'(?:TYPE ")?(\w+)(?:"\s+VERSION : 0\.1\s+| : )STRUCT(.*?)END_STRUCT', text, re.S
        )
    }
    units = re.findall(r'(?:FUNCTION_BLOCK|PROGRAM) "?(\w+)"?\n(.*?)END_(?:FUNCTION_BLOCK|PROGRAM)', text, re.S)
    return {name: Unit(body, types, structs) for name, body in units}
