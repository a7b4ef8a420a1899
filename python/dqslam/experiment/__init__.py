"""The paper's experiment: many trials of one scenario, and the table of their errors."""

from dqslam.experiment.methods import LOSSES as LOSSES
from dqslam.experiment.methods import ROWS as ROWS
from dqslam.experiment.methods import Beliefs as Beliefs
from dqslam.experiment.methods import LossName as LossName
from dqslam.experiment.methods import Method as Method
from dqslam.experiment.methods import RowName as RowName
from dqslam.experiment.methods import Settings as Settings
from dqslam.experiment.methods import beliefs as beliefs
from dqslam.experiment.methods import default_loss as default_loss
from dqslam.experiment.methods import method_options as method_options
from dqslam.experiment.methods import seen_by as seen_by
from dqslam.experiment.paper import example_maps as example_maps
from dqslam.experiment.paper import run_paper as run_paper
from dqslam.experiment.table import METRICS as METRICS
from dqslam.experiment.table import PAPER_ODOMETRY as PAPER_ODOMETRY
from dqslam.experiment.table import PAPER_ROWS as PAPER_ROWS
from dqslam.experiment.table import PaperTable as PaperTable
from dqslam.experiment.table import Statistics as Statistics
from dqslam.experiment.table import TableRow as TableRow
from dqslam.experiment.table import tabulate as tabulate
from dqslam.experiment.trial import Outcome as Outcome
from dqslam.experiment.trial import Trial as Trial
from dqslam.experiment.trial import run_trial as run_trial
from dqslam.experiment.trial import solve_and_score as solve_and_score
