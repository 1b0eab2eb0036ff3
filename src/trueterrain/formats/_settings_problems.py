"""Messages for wrong settings: dotted path, rule and value, from the errors of pydantic."""

import dataclasses
import json
import typing
from collections.abc import Mapping, Sequence
from typing import Any

from trueterrain.core.errors import suggest_name


def problems_of(entries: list[dict[str, Any]], kind: type, values: Mapping[str, Any]) -> list[str]:
    """Problems that a validator found, one phrase each.

    Parameters
    ----------
    entries : list of dict
        Errors of pydantic, of a list that holds the settings.
    kind : type
        Dataclass that describes the settings.
    values : mapping
        Values as the user gave them.

    Returns
    -------
    list of str
        Without repetition. Where a table may be of several classes, only the problems of the class
        that has most of the given keys.
    """
    meant = [entry for entry in entries if _is_meant(entry["loc"][1:], kind, values)]
    return list(dict.fromkeys(_explain_error(entry, kind, values) for entry in meant or entries))


def dataclasses_in(hint: Any) -> list[type]:
    """Dataclasses that a type hint names."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return [hint]
    return [cls for part in typing.get_args(hint) for cls in dataclasses_in(part)]


def _is_meant(location: Sequence[int | str], kind: type, values: Any) -> bool:
    """Whether an error concerns the class of table that has most of the given keys."""
    path: list[str] = []
    here = values
    for part in location:
        in_list = isinstance(here, list) and isinstance(part, int) and part < len(here)
        if in_list or (isinstance(here, Mapping) and part in here):
            here = here[part]
            path.append(str(part))
            continue
        tables = _classes_at(kind, path)
        if isinstance(here, Mapping) and part in [table.__name__ for table in tables]:
            given = set(here)
            nearest = max(tables, key=lambda table: len(given & set(_field_names(table))))
            if part != nearest.__name__:
                return False
    return True


def _explain_error(entry: dict[str, Any], kind: type, values: Mapping[str, Any]) -> str:
    """One problem in one phrase: dotted path, rule, value."""
    missing = entry["type"] in ("missing", "missing_argument")
    path = _user_path(entry["loc"][1:], values, missing=missing)
    name = ".".join(path)
    if entry["type"] in ("unexpected_keyword_argument", "extra_forbidden"):
        known = sorted(
            {field for cls in _classes_at(kind, path[:-1]) for field in _field_names(cls)}
        )
        hint = suggest_name(path[-1], known) or f" (known are {', '.join(known)})"
        return f"{name}: is unknown{hint}"
    if missing:
        return f"{name}: is missing"
    message = str(entry["msg"]).removeprefix("Value error, ").rstrip(".")
    if entry["type"] == "value_error":
        return f"{name}: {message}" if name else message
    message = message.replace("Input should be", "must be")
    message = message.replace("an object", "a table").replace("a valid dictionary", "a table")
    got = entry.get("input")
    shown = "a table" if isinstance(got, Mapping) else json.dumps(got, default=str)
    return f"{name or 'the file'}: {message[:1].lower()}{message[1:]}, got {shown[:60]}"


def _user_path(location: Sequence[int | str], values: Any, *, missing: bool) -> list[str]:
    """Location of an error without the names of classes that pydantic inserts for unions."""
    path, here = [], values
    for index, part in enumerate(location):
        in_list = isinstance(here, list) and isinstance(part, int) and part < len(here)
        if in_list or (isinstance(here, Mapping) and part in here):
            here = here[part]
        elif not (missing and index == len(location) - 1):
            continue  # name of a class of a union
        path.append(str(part))
    return path


def _classes_at(kind: Any, path: Sequence[str]) -> list[type]:
    """Dataclasses that may stand at a dotted path."""
    here = dataclasses_in(kind)
    for part in path:
        if part.isdigit():
            continue  # an entry of an array has the type of the array
        hints = [typing.get_type_hints(cls).get(part) for cls in here]
        here = [cls for hint in hints for cls in dataclasses_in(hint)]
    return here


def _field_names(cls: type) -> list[str]:
    return [field.name for field in dataclasses.fields(cls)]
