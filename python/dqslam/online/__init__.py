"""Estimation step by step: poses and boxes arrive one at a time, an estimate is wanted now."""

from dqslam._core import OnlineOptions as OnlineOptions
from dqslam._core import SmoothingLevel as SmoothingLevel
from dqslam.online.objects import Objects as Objects
from dqslam.online.polish import Polished as Polished
from dqslam.online.relocalize import Relocation as Relocation
from dqslam.online.replay import Frame as Frame
from dqslam.online.replay import replay as replay
from dqslam.online.replay import steps_of as steps_of
from dqslam.online.slam import OnlineSlam as OnlineSlam
from dqslam.online.step import Motion as Motion
from dqslam.online.step import Step as Step
from dqslam.online.step import StepBoxes as StepBoxes
from dqslam.online.step import StepError as StepError
from dqslam.online.step import StepMeasurements as StepMeasurements
from dqslam.online.step import StepPositions as StepPositions
