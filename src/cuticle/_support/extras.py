"""What `pip install cuticle` leaves out, and the one line that says which extra brings it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

EXTRAS = {  # of pyproject.toml, by the package that is missing
    "alembic3d": "alembic",
    "flint": "reference",
    "imath": "alembic",
    "jinja2": "export",
    "matplotlib": "plots",
    "mitsuba": "mitsuba",
    "pxr": "usd",
    "rich": "cli",
    "typer": "cli",
}


class MissingExtraError(ImportError):
    """A package of an extra that is not installed; one line, with the remedy."""


@contextmanager
def needed(what: str) -> Iterator[None]:
    """Turn the absence of a package within into one line: `{what} needs typer: pip install 'cuticle[cli]'`.

    An import that fails for any other reason passes unchanged.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        remedy = f"pip install 'cuticle[{EXTRAS[package]}]'"
        raise MissingExtraError(f"{what} needs {package}, which is not installed: {remedy}", name=package) from None
