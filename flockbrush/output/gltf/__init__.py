"""glTF 2.0 scenes of runs: one binary file with the place and the herd."""
