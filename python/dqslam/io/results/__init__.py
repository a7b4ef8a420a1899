"""Write and read the files of an estimate.

==================  ================================================================================
``trajectory.txt``  TUM: estimated poses, world_from_camera.
``odometry.txt``    TUM: the initial poses, at the same times.
``camera.json``     ``fx fy cx cy width height k1 k2 p1 p2 k3``, as ``io.read_camera`` reads it.
``map.json``        ``objects``: ``id class_name shape center semi_axes orientation_xyzw
                    dual_quadric observations``, ``half_lengths rotation_vector`` of a
                    cuboid or a cylinder, ``doubt`` where its size is not to be believed, and with
                    marginals ``center_covariance`` [m^2], ``log_semi_axes_sigma`` and
                    ``log_half_lengths_sigma``;
                    ``dropped``: ``id reason``; ``tracks`` of what moves, in short.
``covariance.csv``  Covariances of poses, see ``covariances``. Only when marginals are given.
``tracks.csv``      What moves, see ``tracks``. Only when anything does.
``boxes.csv``       A row per box, used or left out, see ``boxes``. Only when boxes are given.
``graph.npz``       The problem that was solved, see ``graph_file``. Only when it is given.
==================  ================================================================================
"""

from dqslam.io.results.boxes import BoxTable as BoxTable
from dqslam.io.results.graph_file import GRAPH_FILE as GRAPH_FILE
from dqslam.io.results.graph_file import SavedGraph as SavedGraph
from dqslam.io.results.graph_file import read_graph as read_graph
from dqslam.io.results.graph_file import write_graph as write_graph
from dqslam.io.results.load import MapObjects as MapObjects
from dqslam.io.results.load import Results as Results
from dqslam.io.results.load import load_map_results as load_map_results
from dqslam.io.results.load import load_results as load_results
from dqslam.io.results.load import read_map as read_map
from dqslam.io.results.map_covariances import ellipsoid_covariances as ellipsoid_covariances
from dqslam.io.results.save import save_estimate as save_estimate
