"""The main job as one command: goals over topics, live progress, plots."""
