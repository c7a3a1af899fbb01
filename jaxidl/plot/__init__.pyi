"""What ``__init__.py`` imports when it is asked for."""

from .ablation import draw_ablation
from .figures import FIGURES, draw_all
from .style import CONTROLLER_NAME, SOURCE_STYLE, house_style, save

__all__ = [
    "CONTROLLER_NAME",
    "FIGURES",
    "SOURCE_STYLE",
    "draw_ablation",
    "draw_all",
    "house_style",
    "save",
]
