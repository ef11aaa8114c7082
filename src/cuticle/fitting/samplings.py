"""Names of what directions are drawn from, apart from the fit: a renderer that fits nothing imports none of it."""

from __future__ import annotations

FORMS = ("lobes", "document")  # of a fit
OWN = "function"  # directions drawn from the function's own density, where it has a closed form
FITTED = (*FORMS, "uniform")  # what else a renderer may draw from
SAMPLINGS = (OWN, *FITTED)
