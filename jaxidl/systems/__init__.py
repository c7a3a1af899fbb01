"""Rigid bodies, and plants built from them."""

from jaxidl.systems.plant import Plant, RigidBody, integrate
from jaxidl.systems.point import PointMass, point_mass

__all__ = ["Plant", "PointMass", "RigidBody", "integrate", "point_mass"]
