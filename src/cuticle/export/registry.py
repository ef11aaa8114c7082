"""What an export host is, and what it is given: a module of `cuticle.export.hosts` with a `HOST` in it is one."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from cuticle._support.progress import Progress
from cuticle.export import hosts
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.bcsdf import Bcsdf
from cuticle.scattering.compact_table import FunctionTable
from cuticle.scattering.family_among import FAMILIES, FamilyAmong
from cuticle.scattering.fibre_tables import FibreTables
from cuticle.scattering.frames import Frame
from cuticle.scattering.host_tables import TOLERANCE

Tables = FibreTables | FunctionTable


@dataclass(frozen=True)
class Export:
    """What an export is: the file's text, and for shaders with a model the texels that go with it.

    Attributes
    ----------
    text
        The file.
    data
        Single-precision values, four a texel, for the texture that a shader reads, where it reads one; else empty.
    table_bytes
        Size of the lobe table in it.
    model
        The scattering function's tables, where they are in it.
    remarks
        What the host's own files need beside it, for the user to read.
    """

    text: str
    table_bytes: int
    data: bytes = b""
    model: Tables | None = None
    remarks: str = ""


@dataclass(frozen=True)
class Job:
    """What a host writes.

    Attributes
    ----------
    sampler
        The sampler.
    name, frame
        Namespace or prefix, and whose frame directions are in.
    about
        Returns lines that say what it is, which takes a measurement.
    tables
        The scattering function's tables, where it goes along.
    model
        The scattering function, where it is known.
    progress
        To be called with a phase and a fraction from 0 to 1.
    """

    sampler: Sampler
    name: str
    frame: Frame
    about: Callable[[], list[str]]
    tables: Tables | None
    model: Bcsdf | None
    progress: Progress

    @property
    def lobe_family(self) -> str:
        """The family's name in the headers."""
        return f"{self.sampler.family.title()}Lobes"


@dataclass(frozen=True)
class FamilyJob:
    """What a host writes of a family: the far field of any fibre.

    Attributes
    ----------
    form
        The name of a strand's own family.
    name, frame
        As a `Job`'s.
    about
        Lines that say what it is.
    among
        The family "dual_scattering" with the strands around, if it is that.
    """

    form: str
    name: str
    frame: Frame
    about: list[str]
    among: FamilyAmong | None = None


@dataclass(frozen=True)
class Host:
    """A host of exports.

    Attributes
    ----------
    about
        A phrase on what the file is.
    write
        Makes the file.
    family
        Makes the file of a family; None where the host takes samplers alone.
    forms
        The families that it takes.
    model
        Whether the scattering function goes along.
    tolerance
        How far its tables may be off, of ∫ f cos.
    tables
        The tables' share of all the work, as progress tells it; what is measured for the text's head takes as much.
    textured
        Whether the scattering function's tables are a texture, in a file beside the text.
    named, framed
        Whether the text has names with the job's name in them, and functions that take directions in its frame.
    reserved, reserved_prefixes, reserved_endings
        What the job's name may not be, begin with and end in.
    """

    about: str
    write: Callable[[Job], Export]
    family: Callable[[FamilyJob], Export] | None = None
    forms: tuple[str, ...] = FAMILIES
    model: Literal["when asked", "always", "never"] = "when asked"
    tolerance: float = TOLERANCE
    tables: float = 0.5
    textured: bool = False
    named: bool = True
    framed: bool = True
    reserved: frozenset[str] = frozenset()
    reserved_prefixes: tuple[str, ...] = ()
    reserved_endings: tuple[str, ...] = ()


def host_names() -> tuple[str, ...]:
    """Return the hosts that there are: the modules of `cuticle.export.hosts`."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(hosts.__path__)))


HOSTS = host_names()


def host(name: str) -> Host:
    """Return a host by name, which must be one of `HOSTS`."""
    made: Host = importlib.import_module(f"cuticle.export.hosts.{name}").HOST
    return made
