"""Analysis of runs: errors, summaries, reports and figures."""
