"""Settings shared by the property tests."""

from hypothesis import settings

# The same examples in every run, so that the suite's verdict is reproducible; `--hypothesis-profile=search` explores.
settings.register_profile("reproducible", derandomize=True, deadline=None, max_examples=100)
settings.register_profile("search", deadline=None, max_examples=3000, print_blob=True)
settings.load_profile("reproducible")
