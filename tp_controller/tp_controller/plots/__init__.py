"""Pictures of a run: curves over time, the arm at some moments, an animation; without ROS."""

from tp_controller.plots.animation import draw_animation
from tp_controller.plots.report import arm, draw_plots, figures
from tp_controller.plots.style import save

__all__ = ['arm', 'draw_animation', 'draw_plots', 'figures', 'save']
