"""The stress suite: hard cases, each with limits, run and judged as one (`sph stress`)."""
