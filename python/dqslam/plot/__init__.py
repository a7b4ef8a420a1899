"""Figures. Nothing here computes results: the numbers come from the layers below."""

from dqslam.plot.maps import plot_maps as plot_maps
