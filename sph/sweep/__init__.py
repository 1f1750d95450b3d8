"""Many runs of one configuration: the product of the values that are varied.

The run directories hold all state of a sweep. A point is run by a process on this machine, a Dask
worker or a Slurm job, which locks the point, looks into its directory and does what is missing.
"""
