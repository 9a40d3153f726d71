"""Many runs of a scene: their parameters, the runs one by one, one table and one report."""
