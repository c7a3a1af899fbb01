"""The paper's simulation study: its numbers, its grid of conditions, its claims. Nothing below
knows them.
"""
