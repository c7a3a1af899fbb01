"""Motions that tell most about what a simulation may be missing."""
