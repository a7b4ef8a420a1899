"""Scenarios: the settings of a simulated world, read from TOML."""

from dqslam.simulation.scenario.calibration import (
    CalibrationErrorSettings as CalibrationErrorSettings,
)
from dqslam.simulation.scenario.camera import CameraSettings as CameraSettings
from dqslam.simulation.scenario.detector import DetectorSettings as DetectorSettings
from dqslam.simulation.scenario.detector import FalseBoxIds as FalseBoxIds
from dqslam.simulation.scenario.detector import WrongAssociationKind as WrongAssociationKind
from dqslam.simulation.scenario.load import load_scenario as load_scenario
from dqslam.simulation.scenario.odometry import GapSettings as GapSettings
from dqslam.simulation.scenario.odometry import JumpSettings as JumpSettings
from dqslam.simulation.scenario.odometry import OdometrySettings as OdometrySettings
from dqslam.simulation.scenario.odometry import PlanarOdometrySettings as PlanarOdometrySettings
from dqslam.simulation.scenario.odometry import SlipSettings as SlipSettings
from dqslam.simulation.scenario.odometry import SpatialOdometrySettings as SpatialOdometrySettings
from dqslam.simulation.scenario.path import FigureOfEightSettings as FigureOfEightSettings
from dqslam.simulation.scenario.path import FlightSettings as FlightSettings
from dqslam.simulation.scenario.path import OrbitSettings as OrbitSettings
from dqslam.simulation.scenario.path import PathSettings as PathSettings
from dqslam.simulation.scenario.path import RoundedRectangleSettings as RoundedRectangleSettings
from dqslam.simulation.scenario.path import StraightSettings as StraightSettings
from dqslam.simulation.scenario.scenario import RelativePositionSettings as RelativePositionSettings
from dqslam.simulation.scenario.scenario import Scenario as Scenario
from dqslam.simulation.scenario.world import AlongPathSettings as AlongPathSettings
from dqslam.simulation.scenario.world import InsidePathSettings as InsidePathSettings
from dqslam.simulation.scenario.world import LogNormalSizeSettings as LogNormalSizeSettings
from dqslam.simulation.scenario.world import ObjectKind as ObjectKind
from dqslam.simulation.scenario.world import OnTableSettings as OnTableSettings
from dqslam.simulation.scenario.world import ProportionSettings as ProportionSettings
from dqslam.simulation.scenario.world import WorldSettings as WorldSettings
