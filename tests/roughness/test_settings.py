"""The keyword `options` of earlier versions."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.core.schemas import make_profile
from trueterrain.roughness import (
    IriSettings,
    PsdSettings,
    RideNumberSettings,
    continuous_iri,
    iri,
    localised_roughness,
    psd,
    ride_number,
)
from trueterrain.roughness.agreement import (
    AgreementSettings,
    filtered_profiles,
    height_errors,
    profile_agreement,
)

S = 0.1 * np.arange(3000.0)
RNG = np.random.default_rng(1)
ROAD, OTHER = (make_profile(S, 0.002 * np.cumsum(RNG.normal(size=S.size))) for _ in range(2))
PAIR = {"A": ROAD, "B": OTHER}
AGREEMENT = AgreementSettings(filter=None, max_shift=1.0, max_scale=0.0)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("call", "arguments", "settings"),
    [
        (iri, (ROAD,), IriSettings(start="level")),
        (continuous_iri, (ROAD, 20.0), IriSettings(window="none")),
        (localised_roughness, (ROAD, 2.5), IriSettings(window="none")),
        (ride_number, (ROAD,), RideNumberSettings(steepness=80.0)),
        (psd, (ROAD,), PsdSettings(confidence=0.5)),
        (profile_agreement, (PAIR,), AGREEMENT),
        (filtered_profiles, (PAIR,), AGREEMENT),
        (height_errors, (PAIR, "A"), AGREEMENT),
    ],
)
def test_the_keyword_options_works_and_warns_with_the_new_one(call, arguments, settings):
    with pytest.warns(DeprecationWarning, match=rf"{call.__name__}\(options=\.\.\.\) is settings="):
        found = call(*arguments, options=settings)
    xr.testing.assert_equal(found, call(*arguments, settings=settings))
    assert not found.equals(call(*arguments))


def test_both_keywords_together_are_refused():
    with pytest.raises(TypeError, match="options"):
        iri(ROAD, options=IriSettings(), settings=IriSettings())
