"""The paper's experiment: many trials of one scenario, and the table of their errors."""

from dqslam.studies.paper.methods import LOSSES as LOSSES
from dqslam.studies.paper.methods import ROWS as ROWS
from dqslam.studies.paper.methods import Assumptions as Assumptions
from dqslam.studies.paper.methods import LossName as LossName
from dqslam.studies.paper.methods import Method as Method
from dqslam.studies.paper.methods import RowName as RowName
from dqslam.studies.paper.methods import Settings as Settings
from dqslam.studies.paper.methods import ShapeName as ShapeName
from dqslam.studies.paper.methods import assumptions_of as assumptions_of
from dqslam.studies.paper.methods import default_loss as default_loss
from dqslam.studies.paper.methods import method_options as method_options
from dqslam.studies.paper.methods import seen_by as seen_by
from dqslam.studies.paper.methods import true_assumptions as true_assumptions
from dqslam.studies.paper.paper import example_maps as example_maps
from dqslam.studies.paper.paper import run_paper as run_paper
from dqslam.studies.paper.table import METRICS as METRICS
from dqslam.studies.paper.table import PAPER_ODOMETRY as PAPER_ODOMETRY
from dqslam.studies.paper.table import PAPER_ROWS as PAPER_ROWS
from dqslam.studies.paper.table import PaperTable as PaperTable
from dqslam.studies.paper.table import Statistics as Statistics
from dqslam.studies.paper.table import TableRow as TableRow
from dqslam.studies.paper.table import tabulate as tabulate
from dqslam.studies.paper.trial import PaperTrial as PaperTrial
from dqslam.studies.paper.trial import ScoredSolve as ScoredSolve
from dqslam.studies.paper.trial import run_trial as run_trial
from dqslam.studies.paper.trial import solve_and_score as solve_and_score
