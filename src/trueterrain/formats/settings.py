"""Settings: read TOML files into frozen dataclasses, and write templates of them.

A dataclass is the only description of its settings: its fields give names and defaults, the text
below each field is the help, ``__post_init__`` checks the values. Nested dataclasses are tables.

Keys that a table omits are taken from the default of its field, which may differ from the defaults
of its class. A field that is None by default may name this default: ``metadata={"table": ...}``.
"""

import ast
import dataclasses
import enum
import inspect
import itertools
import json
import math
import re
import textwrap
import tomllib
import types
import typing
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from trueterrain.core.errors import FormatError
from trueterrain.formats._settings_problems import dataclasses_in, problems_of

Settings = TypeVar("Settings")

_WIDTH = 98  # [characters] of a comment

#: Keys of earlier versions, and their present names.
RENAMED = {
    "largest_angle": "max_angle",
    "largest_angle_sd": "max_angle_sd",
    "largest_clock_sd": "max_clock_sd",
    "largest_lever_sd": "max_lever_sd",
    "largest_range": "max_range",
    "largest_rounds": "max_iterations",
    "largest_sd": "max_sd",
    "least_cells": "min_cells",
    "least_length": "min_length",
    "least_scans": "min_scans",
    "longest_gap": "max_gap",
    "minimum_count": "min_count",
    "minimum_overlap": "min_overlap",
    "most_gaps": "max_gap_fraction",
    "most_rounds": "max_iterations",
    "smallest_bandwidth": "min_bandwidth",
    "way_window": "smoothing_window",
}


def read_settings(kind: type[Settings], path: str | Path) -> Settings:
    r"""Read settings from a TOML file.

    Parameters
    ----------
    kind : type
        Frozen dataclass that describes the settings.
    path : str or Path
        TOML file.

    Returns
    -------
    object
        An instance of `kind`.

    Raises
    ------
    FormatError
        If the file is not TOML, or settings are unknown, missing or break a rule. The message lists
        all of them by their dotted path, and for unknown ones the most similar known name.

    Examples
    --------
    >>> import tempfile
    >>> @dataclasses.dataclass(frozen=True, kw_only=True)
    ... class Scanner:
    ...     beams: int = 940
    ...     "Beams per scan."
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "scanner.toml"
    ...     _ = path.write_text("beams = 271\n")
    ...     read_settings(Scanner, path)
    Scanner(beams=271)
    """
    path = Path(path)
    try:
        values = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise FormatError(
            "is not written in UTF-8", path=path, cure="Save it as UTF-8 text."
        ) from None
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"\((at .*?)\)$", str(error))
        place = found[1].removeprefix("at ") if found else None
        problem = str(error).removesuffix(found[0]).strip() if found else str(error)
        raise FormatError(
            f"is no TOML: {problem[:1].lower()}{problem[1:]}",
            path=path,
            place=place,
            cure="Write keys as `name = value`, and text in quotation marks.",
        ) from None
    return parse_settings(kind, values, path=path)


def parse_settings(
    kind: type[Settings], values: Mapping[str, Any], *, path: str | Path | None = None
) -> Settings:
    """Settings from a mapping.

    Parameters
    ----------
    kind : type
        Frozen dataclass that describes the settings.
    values : mapping
        Values by name; tables are mappings, too.
    path : str or Path, optional
        File of the values, for the message.

    Returns
    -------
    object
        An instance of `kind`.

    Raises
    ------
    FormatError
        As by `read_settings`.

    Examples
    --------
    >>> @dataclasses.dataclass(frozen=True, kw_only=True)
    ... class Scanner:
    ...     beams: int = 940
    >>> parse_settings(Scanner, {"beems": 271})
    Traceback (most recent call last):
    trueterrain.core.errors.FormatError: beems: is unknown (did you mean 'beams'?).
    """
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    # within a list, "forbid" also applies to plain dataclasses, which have no configuration
    adapter = TypeAdapter(list[kind], config=ConfigDict(extra="forbid"))  # type: ignore[valid-type]  # made at run time
    values = _rename_keys(values)
    text = json.dumps([_complete_values(kind, values)], default=str)
    try:
        # strict JSON: arrays may become tuples, but a text does not become a number
        settings: Settings = adapter.validate_json(text, strict=True)[0]
    except ValidationError as error:
        problems = problems_of([dict(entry) for entry in error.errors()], kind, values)
        raise FormatError("; ".join(problems), path=path) from None
    return settings


def _rename_keys(values: Any) -> Any:
    """Rename keys of earlier versions, with a warning that names the new ones."""
    if isinstance(values, list | tuple):
        return [_rename_keys(value) for value in values]
    if not isinstance(values, Mapping):
        return values
    for old in RENAMED.keys() & values.keys():
        message = (
            f"the setting {old} is now {RENAMED[old]}; the old name goes with the next release"
        )
        warnings.warn(message, FutureWarning, stacklevel=4)
    return {RENAMED.get(name, name): _rename_keys(value) for name, value in values.items()}


def settings_template(settings: Any, *, title: str = "") -> str:
    r"""Write settings as TOML: every value, with its help as a comment.

    Parameters
    ----------
    settings : dataclass or type
        Instance whose values are written, or dataclass whose defaults are written. Fields without a
        default are written as comments, to be filled in.
    title : str
        First line; by default the docstring of the class.

    Returns
    -------
    str
        TOML that `read_settings` reads back to the same settings.

    Examples
    --------
    >>> @dataclasses.dataclass(frozen=True, kw_only=True)
    ... class Scanner:
    ...     '''A line scanner.'''
    ...     beams: int = 940
    >>> print(settings_template(Scanner()))
    # A line scanner.
    <BLANKLINE>
    beams = 940
    <BLANKLINE>
    """
    kind = settings if isinstance(settings, type) else type(settings)
    heading = title or _class_summary(kind)
    lines = [*_comment_lines(heading), ""] if heading else []
    lines += _format_table(settings, (), commented=False)
    text = "\n".join(lines)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def check_name(name: str) -> None:
    """Raise a ValueError unless a name can be part of the name of a file.

    Parameters
    ----------
    name : str
        Name of a scene, a pass, a survey, a run or a profile.

    Examples
    --------
    >>> check_name("left/right")
    Traceback (most recent call last):
    ValueError: name must be a word without slashes, got 'left/right'.
    """
    if not name.strip() or name.startswith(".") or not name.isprintable() or set(name) & set("/\\"):
        message = f"name must be a word without slashes, got {name!r}."
        raise ValueError(message)


def attribute_docs(kind: type) -> dict[str, str]:
    """Help of the fields of a dataclass: the text below each of them.

    Parameters
    ----------
    kind : type
        Dataclass.

    Returns
    -------
    dict of str
        Text by name of the field, without line breaks; fields without help are left out.
    """
    docs: dict[str, str] = {}
    for base in reversed(kind.__mro__[:-1]):
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(base)))
        except (OSError, TypeError, SyntaxError):  # made at run time: there is no source
            continue
        body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
        for statement, after in itertools.pairwise(body):
            if not (isinstance(statement, ast.AnnAssign) and isinstance(after, ast.Expr)):
                continue
            name, text = statement.target, after.value
            if isinstance(name, ast.Name) and isinstance(text, ast.Constant):
                docs[name.id] = " ".join(str(text.value).split())
    return docs


def _complete_values(base: Any, given: Mapping[str, Any]) -> dict[str, Any]:
    """Add to values those by which `base`, a dataclass or instance, differs from its class."""
    kind = base if isinstance(base, type) else type(base)
    hints, out = typing.get_type_hints(kind), dict(given)
    if not set(given) <= {field.name for field in dataclasses.fields(kind)}:
        return out  # unknown names are refused, or those of another class of a union
    for field in dataclasses.fields(kind):
        own = _value_of(field, base)
        if field.name not in given:
            if not isinstance(base, type) and own != _value_of(field, kind):
                out[field.name] = dataclasses.asdict(base)[field.name]
            continue
        value, table = given[field.name], _table_of(field, own)
        inner = dataclasses_in(hints[field.name])
        if table is None and len(inner) == 1:
            table = inner[0]
        if table is not None and isinstance(value, Mapping):
            out[field.name] = _complete_values(table, value)
        elif table is not None and isinstance(value, list):
            out[field.name] = [
                _complete_values(table, item) if isinstance(item, Mapping) else item
                for item in value
            ]
    return out


def _table_of(field: Any, value: Any) -> Any:
    """Instance whose values a table takes for keys that it omits, if there is one."""
    table = value if dataclasses.is_dataclass(value) else field.metadata.get("table")
    return None if isinstance(table, type) else table


def _format_table(settings: Any, path: tuple[str, ...], *, commented: bool) -> list[str]:
    """Lines of a table: first its values, then its tables, as TOML requires."""
    kind = settings if isinstance(settings, type) else type(settings)
    docs, hints = attribute_docs(kind), typing.get_type_hints(kind)
    lines: list[str] = []
    tables: list[str] = []
    for field in dataclasses.fields(kind):
        value = _value_of(field, settings)
        inner = dataclasses_in(hints[field.name])
        here = (*path, field.name)
        help_lines = _comment_lines(_with_choices(docs.get(field.name, ""), hints[field.name]))
        if dataclasses.is_dataclass(value):
            tables += _format_section(value, here, help_lines, commented=commented)
        elif isinstance(value, list | tuple) and any(map(dataclasses.is_dataclass, value)):
            tables += _format_section(value[0], here, help_lines, commented=commented, array=True)
            for item in value[1:]:
                tables += _terse_lines(
                    _format_section(item, here, [], commented=commented, array=True)
                )
        elif inner and value in (None, dataclasses.MISSING, (), []):
            array = typing.get_origin(hints[field.name]) in (tuple, list)
            # a required table is not a comment: the user fills in its required values
            as_comment = commented or array or value is not dataclasses.MISSING
            table = _table_of(field, value) or inner[0]
            tables += _format_section(table, here, help_lines, commented=as_comment, array=array)
        else:
            lines += [
                *help_lines,
                _format_assignment(field, value, hints[field.name], commented),
                "",
            ]
    return lines + tables


def _format_section(
    value: Any,
    path: tuple[str, ...],
    help_lines: list[str],
    *,
    commented: bool,
    array: bool = False,
) -> list[str]:
    name = ".".join(path)
    header = f"[[{name}]]" if array else f"[{name}]"
    kind = value if isinstance(value, type) else type(value)
    about = help_lines or _comment_lines(_class_summary(kind))
    body = _format_table(value, path, commented=commented)
    return ["", *about, f"# {header}" if commented else header, *body]


def _terse_lines(lines: list[str]) -> list[str]:
    """Lines of a further table of an array, without the comments of the first."""
    kept = [line for line in lines if line and not line.startswith("#")]
    empty = {
        line
        for line, after in itertools.pairwise([*kept, "["])
        if line.startswith("[") and not line.startswith("[[") and after.startswith("[")
    }
    found: list[str] = []
    for line in kept:
        if line not in empty:
            found += ["", line] if line.startswith("[") else [line]
    return found


def _format_assignment(field: Any, value: Any, hint: Any, commented: bool) -> str:
    if value is dataclasses.MISSING:
        return f"# {field.name} = ... (required: {_type_name(hint)})"
    if value is None:
        return f"# {field.name} = ... (not set: {_type_name(hint)})"
    line = f"{field.name} = {_format_value(value)}"
    if len(line) > _WIDTH and isinstance(value, list | tuple):
        line = "\n".join(
            [f"{field.name} = [", *(f"    {_format_value(item)}," for item in value), "]"]
        )
    return textwrap.indent(line, "# ") if commented else line


def _value_of(field: Any, settings: Any) -> Any:
    if not isinstance(settings, type):
        return getattr(settings, field.name)
    if field.default is not dataclasses.MISSING:
        return field.default
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return dataclasses.MISSING


def _format_value(value: Any) -> str:
    if isinstance(value, enum.Enum):
        return _format_value(value.value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(float(value)) if math.isfinite(value) else str(float(value))
    if isinstance(value, Mapping):
        items = ", ".join(
            f"{_format_key(str(name))} = {_format_value(item)}" for name, item in value.items()
        )
        return f"{{ {items} }}" if items else "{}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_format_value, value))}]"
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def _format_key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _with_choices(text: str, hint: Any) -> str:
    """Help text with the list of allowed values."""
    choices = typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        choices = tuple(hint)
    if len(choices) < 2:
        return text
    return f"{text} One of {', '.join(map(_format_value, choices))}.".strip()


def _type_name(hint: Any) -> str:
    if typing.get_origin(hint) is typing.Literal:
        return " or ".join(_format_value(option) for option in typing.get_args(hint))
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return " or ".join(_drop_empty(_type_name(part) for part in typing.get_args(hint)))
    if typing.get_origin(hint) in (tuple, list):
        parts = [_type_name(part) for part in typing.get_args(hint) if part is not Ellipsis]
        return f"[{', '.join(parts)}{', ...' if Ellipsis in typing.get_args(hint) else ''}]"
    names = {float: "number", int: "whole number", bool: "true or false", str: "text", Path: "text"}
    return names.get(hint, "" if hint is type(None) else getattr(hint, "__name__", str(hint)))


def _drop_empty(names: Iterator[str]) -> list[str]:
    return [name for name in names if name]


def _comment_lines(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.replace("``", "").split()), _WIDTH)]


def _class_summary(kind: type) -> str:
    # a dataclass without a docstring is given its signature as one
    text = inspect.getdoc(kind) or ""
    return "" if text.startswith(f"{kind.__name__}(") else text.partition("\n\n")[0]
