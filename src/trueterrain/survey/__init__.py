"""The whole chain from one file of settings: runs become ground, profiles and a report."""

from trueterrain.survey._chain import RESULT, SurveyResult, run_survey
from trueterrain.survey._check import check_agreement, check_report
from trueterrain.survey._clouds import merge_point_clouds
from trueterrain.survey._settings import (
    MountingOverride,
    OutputSettings,
    ProfilePathSettings,
    RoughnessSettings,
    RunSettings,
    Survey,
    lane_name,
    read_survey,
    survey_of,
    survey_template,
)

__all__ = [
    "RESULT",
    "MountingOverride",
    "OutputSettings",
    "ProfilePathSettings",
    "RoughnessSettings",
    "RunSettings",
    "Survey",
    "SurveyResult",
    "check_agreement",
    "check_report",
    "lane_name",
    "merge_point_clouds",
    "read_survey",
    "run_survey",
    "survey_of",
    "survey_template",
]
