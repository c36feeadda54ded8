"""What the tests of all packages share."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

# The same examples in every run, so that a change is judged by what it changes;
# `HYPOTHESIS_PROFILE=random make test` looks for new ones.
# How long an example takes and how many are left out says nothing about the code.
MILD = {
    'deadline': None,
    # Explaining a failure takes minutes and says little.
    'phases': [phase for phase in Phase if phase is not Phase.explain],
    'suppress_health_check': [HealthCheck.filter_too_much, HealthCheck.too_slow],
}
settings.register_profile('fixed', derandomize=True, **MILD)
settings.register_profile('random', **MILD)
settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'fixed'))

# Resolved: the packages reach this file through links.
REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope='session')
def repository() -> Path:
    """Root folder of the repository."""
    return REPOSITORY


@pytest.fixture(scope='session')
def config() -> Path:
    """Folder of the experiments' parameter files."""
    return REPOSITORY / 'config'
