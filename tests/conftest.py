"""Hypothesis profiles: `quick` for every day and CI, `long` on demand (`pytest --hypothesis-profile=long`)."""

from hypothesis import HealthCheck, settings

# The first call of a kernel compiles it, which no deadline and no health check should mistake for a slow test.
settings.register_profile(
    "quick", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("long", settings.get_profile("quick"), derandomize=False, max_examples=2000)
settings.load_profile("quick")
