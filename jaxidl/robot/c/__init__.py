"""A controller as one C99 file and its header."""

from jaxidl.robot.c.controller import Code, Controller, generate

__all__ = ["Code", "Controller", "generate"]
