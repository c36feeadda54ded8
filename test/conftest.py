"""What the tests of all packages share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples in every run, so that a change is judged by what it changes;
# `HYPOTHESIS_PROFILE=random make test` looks for new ones.
settings.register_profile('fixed', derandomize=True, deadline=None)
settings.register_profile('random', deadline=None)
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
