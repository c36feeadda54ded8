"""A task type of its own package."""
