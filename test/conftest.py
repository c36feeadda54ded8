"""What the tests of all packages share."""

from pathlib import Path

import pytest

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
