"""Learning on a robot: recorded executions in, a feedforward as a folder out."""
