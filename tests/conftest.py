"""Hypothesis profiles: `quick` for every day and CI, `long` on demand (`pytest --hypothesis-profile=long`)."""

from hypothesis import HealthCheck, settings

# The first call of a kernel compiles it, which no deadline and no health check should mistake for a slow test.
# The examples are the same each time, so that many of them find little more than some; `long` draws others.
settings.register_profile(
    "quick", max_examples=50, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
)  # fmt: skip
settings.register_profile("long", settings.get_profile("quick"), derandomize=False, max_examples=2000)
settings.load_profile("quick")
