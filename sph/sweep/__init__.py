"""Many runs of one configuration: the product of the values that are varied.

The run directories are the truth. Whoever runs a point - a process here, a Dask worker, a Slurm
job - looks into its directory, takes its lock, and does what is missing; nobody else has a state.
"""
