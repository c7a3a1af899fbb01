"""Hidden effects: logs from a separate engine, the truth about them, and a workflow's score."""
