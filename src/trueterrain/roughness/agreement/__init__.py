"""Agreement of profiles: cross-correlation of filtered profiles, and errors of heights.

============  =================================================================================
`settings`    filter, and ranges of the search for shift and distance error
`rating`      cross-correlation rating of every pair, repeatability, accuracy, distance error
`heights`     errors of heights after registration, bias and precision of repeats
`limits`      results against limits of the user
============  =================================================================================
"""

from trueterrain.roughness.agreement.heights import height_errors
from trueterrain.roughness.agreement.limits import AgreementLimits, LimitCheck, check_limits
from trueterrain.roughness.agreement.rating import filtered_profiles, profile_agreement
from trueterrain.roughness.agreement.settings import AIRFIELD_FILTER, IRI_FILTER, AgreementSettings

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
