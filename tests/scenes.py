"""Tests that are coroutines."""

import asyncio
from collections.abc import Callable, Coroutine
from functools import wraps
from typing import Any


def played(scene: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Return a test that runs a coroutine to its end; its parameters are fixtures."""

    @wraps(scene)
    def play(**given: object) -> None:
        asyncio.run(scene(**given))

    return play
