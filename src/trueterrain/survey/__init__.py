"""Surveys: the chain from recorded runs to surfaces, profiles, roughness and a report.

Each step is a function, and `run_survey` calls them in this order with the settings of one file:

====================  ===========================================================================
`process_run`         motion of a recorded run
`align_passes`        passes over the same ground brought into agreement
`georeference_run`    points of all returns
`build_surface`       one surface of all runs, small holes filled
`extract_profiles`    profiles along paths, as a tyre feels them
`rate_profiles`       IRI of the profiles
====================  ===========================================================================
"""

from trueterrain.survey._chain import (
    RESULT,
    SurveyResult,
    process_survey_run,
    run_survey,
)
from trueterrain.survey._check import (
    check_agreement,
    check_point_clouds,
    check_report,
    check_runs,
)
from trueterrain.survey._clouds import merge_point_clouds
from trueterrain.survey._settings import (
    MountingOverride,
    OutputSettings,
    ProfilePathSettings,
    RoughnessSettings,
    RunSettings,
    Survey,
    read_survey,
    run_name,
    survey_of,
    survey_template,
)
from trueterrain.survey.profiles import (
    extract_profile,
    extract_profiles,
    rate_profiles,
    rate_wheel_paths,
)
from trueterrain.survey.runs import ProcessedRun, align_passes, georeference_run, process_run
from trueterrain.survey.surfaces import build_surface, complete_surface, grid_point_files

__all__ = [
    "RESULT",
    "MountingOverride",
    "OutputSettings",
    "ProcessedRun",
    "ProfilePathSettings",
    "RoughnessSettings",
    "RunSettings",
    "Survey",
    "SurveyResult",
    "align_passes",
    "build_surface",
    "check_agreement",
    "check_point_clouds",
    "check_report",
    "check_runs",
    "complete_surface",
    "extract_profile",
    "extract_profiles",
    "georeference_run",
    "grid_point_files",
    "merge_point_clouds",
    "process_run",
    "process_survey_run",
    "rate_profiles",
    "rate_wheel_paths",
    "read_survey",
    "run_name",
    "run_survey",
    "survey_of",
    "survey_template",
]
