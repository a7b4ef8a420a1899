"""Figures. Their numbers come from the layers below; nothing is computed here."""

from dqslam.plot.maps import plot_maps as plot_maps
from dqslam.plot.results import Drawn as Drawn
from dqslam.plot.results import plot_results as plot_results
