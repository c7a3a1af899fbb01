"""What several test files share: data, models, logs, comparisons. Fixtures: ``conftest.py``."""
