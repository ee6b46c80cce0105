"""Options of commands as keywords that `help`, editors and `typing.get_type_hints` know."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

Function = TypeVar("Function", bound=Callable[..., Any])


def keywords(types: dict[str, Any], options: type) -> Callable[[Function], Function]:
    """Names the keywords that a function takes as `**options`, with their types and the default, `None`, which is the command's own.

    Args:
        types: what the names stand for that the module of the options has for type checkers alone.
        options: the options, as a `TypedDict`.
    """
    hints = get_type_hints(options, None, types)

    def named(function: Function) -> Function:
        signature = inspect.signature(function)
        own = [parameter for parameter in signature.parameters.values() if parameter.kind is not parameter.VAR_KEYWORD]
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=options.__annotations__[name])
            for name in hints
        ]
        shown = [parameter.replace(annotation=_shown(parameter.annotation)) for parameter in added]
        del function.__annotations__["options"]
        function.__annotations__.update(hints)
        setattr(function, "__signature__", signature.replace(parameters=own + shown))  # noqa: B010
        return function

    return named


def _shown(annotation: Any) -> Any:
    """The text of an annotation that has not been evaluated."""
    return getattr(annotation, "__forward_arg__", annotation)
