"""The battery of worlds: kinds of worlds unlike the paper's, and how the estimator does there."""

from dqslam.studies.worlds.battery import WORLDS as WORLDS
from dqslam.studies.worlds.battery import all_worlds as all_worlds
from dqslam.studies.worlds.rows import ROWS as ROWS
from dqslam.studies.worlds.rows import RowName as RowName
from dqslam.studies.worlds.rows import possible_rows as possible_rows
from dqslam.studies.worlds.rows import usual_rows as usual_rows
from dqslam.studies.worlds.rows import wrong_parameters as wrong_parameters
from dqslam.studies.worlds.run import run_worlds as run_worlds
from dqslam.studies.worlds.summary import RowSummary as RowSummary
from dqslam.studies.worlds.summary import WorldsSummary as WorldsSummary
from dqslam.studies.worlds.summary import WorldSummary as WorldSummary
from dqslam.studies.worlds.summary import summarize as summarize
from dqslam.studies.worlds.table import NUMBERS as NUMBERS
from dqslam.studies.worlds.table import around_table as around_table
from dqslam.studies.worlds.table import cells as cells
from dqslam.studies.worlds.table import markdown as markdown
from dqslam.studies.worlds.table import number as number
from dqslam.studies.worlds.table import replace_table as replace_table
from dqslam.studies.worlds.table import save_results as save_results
from dqslam.studies.worlds.trial import LOST_COST as LOST_COST
from dqslam.studies.worlds.trial import WorldSolve as WorldSolve
from dqslam.studies.worlds.trial import WorldTrial as WorldTrial
from dqslam.studies.worlds.trial import run_trial as run_trial
