"""How well profiles agree: by cross-correlation behind a filter, and point by point.

============  =================================================================================
`options`     filter before, and how far shift and distance are sought
`rating`      cross-correlation rating of every pair, repeatability, accuracy, distance error
`heights`     errors of heights after registration, bias and precision of repeats
`limits`      verdicts by limits of the user
============  =================================================================================
"""

from trueterrain.roughness.agreement.heights import height_errors
from trueterrain.roughness.agreement.limits import AgreementLimits, LimitCheck, check_limits
from trueterrain.roughness.agreement.options import AIRFIELD_FILTER, IRI_FILTER, AgreementSettings
from trueterrain.roughness.agreement.rating import filtered_profiles, profile_agreement

__all__ = [
    "AIRFIELD_FILTER",
    "IRI_FILTER",
    "AgreementLimits",
    "AgreementSettings",
    "LimitCheck",
    "check_limits",
    "filtered_profiles",
    "height_errors",
    "profile_agreement",
]
