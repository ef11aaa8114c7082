"""The reference: values of the scattering functions with proven errors, and a check of someone's values beside them."""

from cuticle.reference.comparison import check as check
from cuticle.reference.findings import Findings as Findings
from cuticle.reference.making import Reference as Reference
from cuticle.reference.making import make as make
from cuticle.reference.values_file import Submission as Submission
from cuticle.reference.values_file import read as read

__all__ = ["Findings", "Reference", "Submission", "check", "make", "read"]
