"""The known slips of the density alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cuticle.reference.slips import CONSERVING, Slip, cosine_i, having, pdf_times
from cuticle.scattering.bcsdf import luminance_weights

DENSITY = (
    Slip("bins-64-63", "pdf factor", "64 bins are drawn from, the density is that of 63",
         "p = w_k · 64/(2π)", "w_k · 63/(2π)",
         pdf_times(lambda q: 63 / 64), pdf=True),
    Slip("bins-63-64", "pdf factor", "63 bins are drawn from, the density is that of 64",
         "p = w_k · 63/(2π)", "w_k · 64/(2π)",
         pdf_times(lambda q: 64 / 63), pdf=True),
    Slip("pdf-over-pi", "pdf factor", "the density is divided by π",
         "p", "p/π",
         pdf_times(lambda q: 1 / np.pi), pdf=True),
    Slip("pdf-per-angle", "pdf cosine", "the density is per dθ dφ, not per steradian",
         "p", "p cos θ_i",
         pdf_times(cosine_i), pdf=True),
    Slip("pdf-no-cosine", "pdf cosine", "the density is that of f, not of f cos θ_i, or divided by the cosine",
         "p", "p/cos θ_i",
         pdf_times(lambda q: 1 / cosine_i(q)), pdf=True),
    Slip("pdf-one", "pdf factor", "the density is returned as 1",
         "p", "1",
         lambda F: replace(F, finish_pdf=lambda q, p: 0 * p + 1), pdf=True),
    Slip("pdf-mean-of-channels", "pdf weights",
         "lobes are chosen by the mean of the channels (a choice; it is pbrt-v4's)",
         "luminance of A_p", "mean of A_p",
         having(pdf_weights=lambda n: np.full(n, 1 / n)), pdf=True, approximation=True),
    Slip("pdf-green", "pdf weights", "lobes are chosen by the second channel",
         "luminance of A_p", "A_p of the second channel",
         having(pdf_weights=lambda n: np.eye(n)[min(1, n - 1)]), pdf=True),
    Slip("pdf-red", "pdf weights", "lobes are chosen by the first channel",
         "luminance of A_p", "A_p of the first channel",
         having(pdf_weights=lambda n: np.eye(n)[0]), pdf=True),
    Slip("pdf-blue", "pdf weights", "lobes are chosen by the last channel",
         "luminance of A_p", "A_p of the last channel",
         having(pdf_weights=lambda n: np.eye(n)[-1]), pdf=True),
    Slip("pdf-largest-channel", "pdf weights", "lobes are chosen by the largest channel (a choice)",
         "luminance of A_p", "max over channels of A_p",
         having(chosen_by=lambda a: a.max(axis=-1)), CONSERVING, pdf=True, approximation=True, only="near"),
    Slip("pdf-equal-lobes", "pdf weights", "every lobe is chosen as often (a choice)",
         "luminance of A_p", "the same for every p",
         having(chosen_by=lambda a: np.ones(a.shape[:-1])), CONSERVING, pdf=True, approximation=True, only="near"),
    Slip("pdf-unnormalised", "pdf factor", "the lobes' energies are not divided by their sum",
         "Σ A_p M_p N_p/Σ A_p", "Σ A_p M_p N_p",
         pdf_times(lambda q: q.whole), CONSERVING, pdf=True),
    Slip("pdf-uniform", "pdf factor", "the density is that of the uniform sphere",
         "p", "1/(4π)",
         lambda F: replace(F, finish_pdf=lambda q, p: 0 * p + 0.25 / np.pi), pdf=True),
    Slip("pdf-channels-reversed", "pdf weights", "red and blue are exchanged in the luminance",
         ".2126, .7152, .0722", ".0722, .7152, .2126",
         having(pdf_weights=lambda n: luminance_weights(n)[::-1]), pdf=True),
    Slip("pdf-rec601", "pdf weights", "the luminance is that of Rec. 601 (a choice)",
         ".2126, .7152, .0722", ".299, .587, .114",
         having(pdf_weights=lambda n: np.array([0.299, 0.587, 0.114]) if n == 3 else np.full(n, 1 / n)),
         pdf=True, approximation=True),
    Slip("pdf-of-theta-h", "pdf factor", "the density of θ_h is taken for that of θ_i",
         "dθ_i = 2 dθ_h: g(θ_h)/2 …", "g(θ_h) …",
         pdf_times(lambda q: 2.0), ("gaussian",), pdf=True),
)  # fmt: skip
