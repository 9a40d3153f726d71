"""A scene from grains on disk to a run folder: preparation, time loop, results, checkpoints."""
