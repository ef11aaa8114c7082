"""The parser of one declaration."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NoReturn

from cuticle.export.formulas.syntax import (  # fmt: skip
    Alias,
    Assign,
    Call,
    Constant,
    Declaration,
    Enumeration,
    Expr,
    For,
    Function,
    If,
    Index,
    Member,
    Name,
    Number,
    Operator,
    Parameter,
    Return,
    Statement,
    Struct,
    SubsetError,
    Token,
    Using,
    Variable,
)

_NEVER = {"break", "case", "continue", "do", "goto", "new", "operator", "switch", "throw", "void", "while"}
_BEFORE = {"inline", "constexpr", "CUTICLE_HD", "CUTICLE_INLINE", "static"}
_LEVELS = (("||",), ("&&",), ("&", "|"), ("==", "!="), ("<", ">", "<=", ">="), ("+", "-"), ("*", "/", "%"))


class Parser:
    """Reads one declaration from its tokens. `templates` says which names a < opens arguments after."""

    def __init__(self, stream: list[Token], scope: str, name: str, templates: frozenset[str], comment: str = "") -> None:
        self.stream = [t for t in stream if t.kind != "comment"]
        self.scope, self.name, self.templates, self.comment = scope, name, templates, comment
        self.at = 0
        self.locals: set[str] = set()

    def refuse(self, why: str, token: Token | None = None) -> NoReturn:
        """Raise SubsetError."""
        token = token or self.here
        raise SubsetError(f"{self.name}: {why} is outside the subset of C++ for formulas (line {token.line})")

    @property
    def here(self) -> Token:
        """The next token."""
        return self.stream[self.at] if self.at < len(self.stream) else Token("end", "the end", self.stream[-1].line)

    def next(self) -> Token:
        """Take a token."""
        token = self.here
        self.at += 1
        return token

    def take(self, text: str) -> bool:
        """Take a token if it is `text`."""
        if self.here.text == text and self.here.kind != "end":
            self.at += 1
            return True
        return False

    def want(self, text: str) -> None:
        """Take `text`."""
        if not self.take(text):
            self.refuse(f"{self.here.text!r}, where {text!r} would go on,")

    def word(self) -> str:
        """Take a name."""
        if self.here.kind != "name" or self.here.text in _NEVER:
            self.refuse(f"{self.here.text!r}" + ("" if self.here.text in _NEVER else ", where a name would go on,"))
        return self.next().text

    # -- declarations --

    def declaration(self) -> Declaration:
        """Read all tokens as one declaration."""
        template = self.template()
        before = set()
        while self.here.text in _BEFORE:
            before.add(self.next().text)
        if self.take("enum"):
            return self.enumeration()
        if self.take("struct"):
            return self.struct(template)
        if self.take("using"):
            name = self.word()
            self.want("=")
            return Alias(self.scope, name, template, self.type())
        kind = self.type()
        name = self.word()
        if self.take("="):
            return Constant(self.scope, name, self.comment, template, kind, self.expression())
        self.want("(")
        parameters: list[Variable] = []
        while not self.take(")"):
            parameters.append(self.parameter(len(parameters)))
            if self.here.text != ")":
                self.want(",")
        self.locals |= {p.name for p in parameters}
        body = self.block()
        return Function(self.scope, name, self.comment, template, kind, tuple(parameters), body, "constexpr" in before)

    def template(self) -> tuple[Parameter, ...]:
        """Read template <...>, if it is there."""
        if not self.take("template"):
            return ()
        self.want("<")
        out = []
        while not self.take(">"):
            kind = {"typename": "class"}.get(self.here.text, self.word())
            if kind not in ("class", "bool", "int"):
                self.refuse(f"a template parameter of type {kind!r}")
            name = self.word() if self.here.kind == "name" else ""
            pointer = self.here.text == "=" and self.stream[self.at + 1].text == "const"
            out.append(Parameter(kind, name, self.sum() if not pointer and self.take("=") else None))
            while pointer and self.here.text not in (",", ">"):  # no type of a shader
                self.next()
            if self.here.text != ">":
                self.want(",")
        return tuple(out)

    def enumeration(self) -> Enumeration:
        """Read what follows enum."""
        self.take("class")
        name = self.word() if self.here.kind == "name" else ""
        self.want("{")
        members = []
        while not self.take("}"):
            members.append(self.word())
            if self.here.text != "}":
                self.want(",")
        return Enumeration(self.scope, name, tuple(members))

    def struct(self, template: tuple[Parameter, ...]) -> Struct:
        """Read what follows struct."""
        name = self.word()
        self.want("{")
        fields: list[Variable] = []
        while not self.take("}"):
            if not self.skip_member():
                fields += self.variables(self.type())
        return Struct(self.scope, name, self.comment, template, tuple(fields))

    def skip_member(self) -> bool:
        """Pass over a function, a constant or a struct within, which are found by their own names."""
        at, depth = self.at, 0
        while not (depth == 0 and self.stream[at].text in (";", "(", "{", "=")):
            depth += (self.stream[at].text == "<") - (self.stream[at].text == ">")
            at += 1
        first = self.here.text
        if self.stream[at].text == ";" or (
            self.stream[at].text != "(" and first not in ("static", "struct", "template", "enum")
        ):
            return False
        while True:
            text = self.next().text
            depth += (text in ("{", "(")) - (text in ("}", ")"))
            if depth == 0 and (text == ";" or (text == "}" and not self.take(";"))):
                return True
            if depth == 0 and text == "}":
                return True

    def parameter(self, index: int) -> Variable:
        """Read one parameter of a function."""
        constant = self.take("const")
        kind = self.type()
        reference = self.take("&")
        name = self.word() if self.here.kind == "name" else f"unused_{index}"
        length = self.length()
        changes = not constant and (reference or length is not None)
        return Variable(kind, name, length=length, constant=constant, changes=changes)

    def type(self) -> Name:
        """Read a type."""
        self.take("typename")
        return self.name_of(always=True)

    def name_of(self, *, always: bool = False) -> Name:
        """Read a name with its scopes and, where it is a template's, what it is given."""
        path, is_template = self.word(), False
        while self.take("::"):
            is_template = self.take("template")
            path += "::" + self.word()
        arguments, member = None, ""
        is_template = is_template or (path.rsplit("::", 1)[-1] in self.templates and path not in self.locals)
        if self.here.text == "<" and (always or is_template):
            self.next()
            given = []
            while not self.take(">"):
                given.append(self.sum())
                if self.here.text != ">":
                    self.want(",")
            arguments = tuple(given)
            if self.take("::"):
                member = self.word()
        return Name(path, arguments, member)

    # -- statements --

    def block(self) -> tuple[Statement, ...]:
        """Read { ... }."""
        self.want("{")
        out: list[Statement] = []
        while not self.take("}"):
            out += self.statement()
        return tuple(out)

    def body(self) -> tuple[Statement, ...]:
        """Read a block, or the one statement that stands for it."""
        return self.block() if self.here.text == "{" else tuple(self.statement())

    def statement(self) -> Iterator[Statement]:
        """Read a statement; a declaration of several names is several."""
        if self.take("return"):
            value = self.value()
            self.want(";")
            yield Return(value)
        elif self.take("if"):
            constant = self.take("constexpr")
            self.want("(")
            condition = self.expression()
            self.want(")")
            then = self.body()
            yield If(condition, then, self.body() if self.take("else") else (), constant)
        elif self.take("for"):
            yield self.loop()
        elif self.take("using"):
            name = self.word()
            self.want("=")
            kind = self.type()
            self.want(";")
            yield Using(name, kind)
        elif self.here.text in ("const", "constexpr"):
            while self.take("const") or self.take("constexpr"):
                pass
            yield from self.variables(self.type(), constant=True)
        elif self.declares():
            yield from self.variables(self.type())
        else:
            yield self.assignment()

    def declares(self) -> bool:
        """Whether a type and a name come next."""
        if self.here.kind != "name" or self.here.text in self.locals:
            return False
        start, self.at = self.at, self.at
        try:
            self.type()
            return self.here.kind == "name"
        except SubsetError:
            return False
        finally:
            self.at = start

    def variables(self, kind: Name, *, constant: bool = False) -> Iterator[Variable]:
        """Read the names that a declaration makes, to its semicolon."""
        while True:
            if self.here.text in ("*", "&", "&&"):
                self.refuse(f"a pointer or reference ({self.here.text!r})")
            name = self.word()
            value: Expr | None = None
            self.locals.add(name)
            length, width = self.length(), self.length()
            if self.here.text == "{":
                value = self.braced(None)
            elif self.take("("):
                value = Call(kind, (self.expression(),))
                self.want(")")
            elif self.take("="):
                value = self.value()
            yield Variable(kind, name, value, length, width, constant)
            if not self.take(","):
                self.want(";")
                return

    def value(self) -> Expr:
        """Read a list in braces, or an expression."""
        return self.braced(None) if self.here.text == "{" else self.expression()

    def length(self) -> Expr | int | None:
        """Read [length] or [], if it is there."""
        if not self.take("["):
            return None
        length: Expr | int = 0 if self.here.text == "]" else self.expression()
        self.want("]")
        return length

    def loop(self) -> For:
        """Read what follows for: an int that counts up."""
        self.want("(")
        if not self.take("int"):
            self.refuse(f"a loop over {self.here.text!r}")
        name = self.word()
        self.locals.add(name)
        self.want("=")
        start = self.expression()
        self.want(";")
        condition = self.expression()
        if not (isinstance(condition, Operator) and condition.symbol == "<" and condition.operands[0] == Name(name)):
            self.refuse("a loop that is not counted up with <")
        self.want(";")
        step: Expr | None = Number("1") if self.take("++") else None
        if self.word() != name:
            self.refuse("a loop that counts something else")
        if step is None:
            self.want("+=")
            step = self.expression()
        self.want(")")
        return For(name, start, condition.operands[1], step, self.body())

    def assignment(self) -> Assign:
        """Read a target and its new value."""
        target = self.unary()
        if isinstance(target, Call) and self.take(";"):
            return self.stored(target)
        symbol = self.next().text
        if symbol not in ("=", "+=", "-=", "*=", "/="):
            self.refuse(f"{symbol!r}")
        value = self.value()
        self.want(";")
        return Assign(target, symbol, value)

    def stored(self, call: Call) -> Assign:
        """What a call of one of the two functions that write to an element stands for."""
        match call:
            case Call(Member(x, "set"), (i, value)) | Call(Name("store_abreast"), (value, x, i)):
                return Assign(Index(x, i), "=", value)
        return self.refuse("a call whose value is not used")

    # -- expressions --

    def expression(self) -> Expr:
        """Read an expression."""
        condition = self.binary(0)
        if not self.take("?"):
            return condition
        then = self.expression()
        self.want(":")
        return Operator("?", (condition, then, self.expression()))

    def sum(self) -> Expr:
        """Read what may stand between < and >, where > is no comparison."""
        return self.binary(5)

    def binary(self, level: int) -> Expr:
        """Read operators from a level of precedence on."""
        if level == len(_LEVELS):
            return self.unary()
        left = self.binary(level + 1)
        while self.here.kind == "mark" and self.here.text in _LEVELS[level]:
            left = Operator(self.next().text, (left, self.binary(level + 1)))
        return left

    def unary(self) -> Expr:
        """Read - or ! and what follows, or a name, a number, a call and its members."""
        if self.here.text in ("-", "!"):
            return Operator(self.next().text, (self.unary(),))
        if self.here.text in ("&", "*", "++", "--", "[", "~"):
            self.refuse(f"{self.here.text!r}")
        if self.here.kind == "number":
            value: Expr = Number(self.next().text)
        elif self.take("("):
            value = self.expression()
            self.want(")")
        elif self.here.text == "typename":
            value = self.type()
        else:
            value = self.name_of()
        while self.here.text in ("(", ".", "[") or (self.here.text == "{" and isinstance(value, Name)):
            if self.here.text == "{":
                value = self.braced(value)
            elif self.take("("):
                value = Call(value, self.list_to(")"))
            elif self.take("."):
                value = Member(value, self.word())
            else:
                self.want("[")
                value = Index(value, self.expression())
                self.want("]")
        return value

    def braced(self, kind: Expr | None) -> Call:
        """Read {...}."""
        self.want("{")
        return Call(kind, self.list_to("}"), braces=True)

    def list_to(self, end: str) -> tuple[Expr, ...]:
        """Read expressions with commas between, and `end`."""
        out: list[Expr] = []
        while not self.take(end):
            out.append(self.value())
            if self.here.text != end:
                self.want(",")
        return tuple(out)
