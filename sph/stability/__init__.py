"""How far C or eta of a configuration is from where its runs stop being good, by bisection."""
