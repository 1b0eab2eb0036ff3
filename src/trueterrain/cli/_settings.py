"""Settings as options: a command takes dataclasses of settings, and each field is an option."""

import functools
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Annotated, Any, get_type_hints

from cyclopts import Group, Parameter

from trueterrain.cli._options import INTEGER
from trueterrain.formats.settings import attribute_docs


@dataclass(frozen=True, kw_only=True)
class Flattened:
    """Mark of a parameter of a command whose fields are options; see `flatten_settings`."""

    group: str | Group
    "Title of the options in the help."

    names: Mapping[str, str | None] = field(default_factory=dict)
    """Names of parameters of the command for fields whose own names do not fit; None for fields
    that are no options. Fields that are dataclasses themselves are none either."""


def flatten_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the settings that a command takes into options, one for each field.

    Name, type and help of an option are those of the field, its default that of the settings by
    which the parameter is preset. cyclopts flattens dataclasses as well, but takes the defaults of
    the class, and neither checks numbers nor refuses 1.5 for an integer.

    Parameters
    ----------
    command : callable
        Command with keyword-only parameters such as
        ``cells: Annotated[GridSettings, Flattened(group="Cells")] = GridSettings()``.

    Returns
    -------
    callable
        Command with the options as parameters.
    """
    signature = inspect.signature(command)
    parameters: list[inspect.Parameter] = []
    fields_of: dict[str, dict[str, str]] = {}  # field by option, for each parameter of settings
    for parameter in signature.parameters.values():
        marks = getattr(parameter.annotation, "__metadata__", ())
        mark = next((one for one in marks if isinstance(one, Flattened)), None)
        if mark is None:
            parameters.append(parameter)
        else:
            options = _field_options(parameter.default, mark)
            fields_of[parameter.name] = {option.name: name for name, option in options.items()}
            parameters += options.values()

    @functools.wraps(command)
    def flattened(*positional: Any, **given: Any) -> None:
        for name, field_names in fields_of.items():
            values = {field_names[key]: given.pop(key) for key in field_names if key in given}
            given[name] = replace(signature.parameters[name].default, **values)
        command(*positional, **given)

    flattened.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]  # as inspect documents it
    flattened.__annotations__ = {one.name: one.annotation for one in parameters}
    return flattened


def _field_options(settings: Any, mark: Flattened) -> dict[str, inspect.Parameter]:
    """Parameters of a command for the fields of settings, by the names of the fields."""
    docs, hints = attribute_docs(type(settings)), get_type_hints(type(settings))
    options = {}
    for entry in fields(settings):
        name = mark.names.get(entry.name, entry.name)
        preset, hint = getattr(settings, entry.name), hints[entry.name]
        if name is None or is_dataclass(preset):
            continue
        if preset in ((), math.inf):  # no names, no limit: said best by no value
            preset, hint = None, hint | None
        described = Parameter(group=mark.group, help=docs[entry.name])
        number = [INTEGER] if hint in (int, int | None) else []
        options[entry.name] = inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=preset,
            annotation=Annotated[hint, described, *number],
        )
    return options
