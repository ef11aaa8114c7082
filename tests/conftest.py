"""What the tests share: fits made once, and the folder of reference data."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import cuticle
from cuticle.document import Document, Printed, document

COUNTS = (0.0, 1.0, 2.0, 4.0, 8.0)


@pytest.fixture(scope="session")
def document_model() -> cuticle.DualScattering:
    return cuticle.DualScattering(cuticle.Fibre.preset("document"))


@pytest.fixture(scope="session")
def document_fit(document_model: cuticle.DualScattering) -> cuticle.Fit:
    return cuticle.fit(document_model, 4, strands=COUNTS)


@pytest.fixture(scope="session")
def sharp_fit() -> tuple[cuticle.DualScattering, cuticle.Fit]:
    model = cuticle.DualScattering(cuticle.Fibre(alpha_R=-7.5, beta_R=7.5, sigma_a=0.6, beta_N=3))
    return model, cuticle.fit(model, 8, strands=COUNTS)


@pytest.fixture(scope="session")
def reproduced(document_model: cuticle.DualScattering, document_fit: cuticle.Fit) -> Document:
    """The draft for its own fibre, beside the printed tables where they are at hand."""
    return document(document_model, printed=Printed.find(), lobes=document_fit, name="document")


@pytest.fixture(scope="session")
def data() -> Path:
    folder = Path(os.environ.get("CUTICLE_DATA", Path(__file__).parents[1] / "../shared/data"))
    if not (folder / "document" / "table2.csv").exists():
        pytest.skip(f"reference data is not at {folder}; set CUTICLE_DATA")
    return folder


def sphere(n_theta: int, n_phi: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Midpoints over the sphere, and a cell's d theta d phi."""
    theta = (np.arange(n_theta) + 0.5) / n_theta * np.pi - np.pi / 2
    phi = (np.arange(n_phi) + 0.5) / n_phi * 2 * np.pi - np.pi
    return theta[:, None], phi[None, :], np.pi / n_theta * 2 * np.pi / n_phi
