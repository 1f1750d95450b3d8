"""The range of C or eta for which runs of a configuration stay stable, by bisection."""
