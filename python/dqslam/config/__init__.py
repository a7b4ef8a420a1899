"""Settings in TOML files: they are read into models, with every mistake named, and written."""

from dqslam.config.lines import key_lines as key_lines
from dqslam.config.model import TomlFile as TomlFile
from dqslam.config.model import check_model as check_model
from dqslam.config.model import load_toml_model as load_toml_model
from dqslam.config.model import read_toml as read_toml
from dqslam.config.model import right_keys as right_keys
from dqslam.config.model import unknown_keys as unknown_keys
from dqslam.config.write import toml_text as toml_text
