"""Hidden effects: logs made by an engine of its own, the truth about them, and the score of what a
workflow says.
"""
