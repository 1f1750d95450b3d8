"""How many examples: few by default, `--hypothesis-profile=long` for the 2,000 of a long run."""

from hypothesis import HealthCheck, settings

COMMON = {
    "deadline": None,  # the first example of a scene compiles it
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
}
# The few are the same every time, so that what passes here passes elsewhere.
settings.register_profile("few", max_examples=25, derandomize=True, database=None, **COMMON)
settings.register_profile("long", max_examples=2000, **COMMON)
settings.load_profile("few")
