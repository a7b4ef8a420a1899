"""Settings of the site: ./run docs builds it from this folder into build/docs."""

import os
import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(DOCS / "extensions"))

project = "dqslam"
author = "The dqslam authors"
copyright = author
version = release = re.search(
    r"VERSION\s+(\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
)[1]

extensions = [
    "myst_nb",  # Markdown too
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    # From docs/extensions:
    "api_signatures",
    "mathml",
    "paper_table",
    "repository_pages",
]
exclude_patterns = ["extensions", "_generated/gallery/*.ipynb", "_generated/gallery/*.py"]
# What the build writes into this folder; git ignores it.
generated = DOCS / "_generated"

# Markdown as a forge shows it: $ for mathematics, headings as targets of links.
myst_enable_extensions = ["dollarmath", "fieldlist", "attrs_inline"]
myst_heading_anchors = 3

# Notebooks have no stored output: the build executes them, and an error ends it.
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

# Every name in a signature is a link or is listed here: what other projects document.
nitpicky = True
nitpick_ignore_regex = [
    (
        "py:.*",
        r"(numpy|np|pathlib|collections|concurrent|typing|pydantic|typer|enum|matplotlib)\..*",
    ),
    (
        "py:.*",
        r"(Any|ArrayLike|NDArray|ndarray|float32|float64|int64|uint8|bool|Align|Ids|TypeAliasForwardRef)",
    ),
    (
        "py:.*",
        r"dict\[.*|dqslam\.studies\.paper\.methods\.Settings|dqslam\.io\.results\.(save|graph_file)\..*",
    ),
    (
        "py:.*",
        r"dqslam\.(solids\.solids|view\.(scene|body|foxglove|surface_mesh)|studies\.(sweep|batch)|plot)\..*",
    ),
    ("py:.*", r"dqslam\.association\.scene_map\.SceneMap"),  # the inside of an association
    (
        "py:.*",
        r"dqslam\.places\.(sensor\.Sensor|upright\.Upright|merging\.together\.Solved)",
    ),  # that of a map
]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {name: name for name in ("Align", "Ids")}
autodoc_preserve_defaults = True
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
python_maximum_signature_line_length = 80
add_module_names = False
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = f"dqslam {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_theme_options = {
    "sidebar_hide_name": False,
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#56B4E9"},
}

# Where the tests look for real recordings too; an example does without where there are none.
os.environ.setdefault("DQSLAM_REALDATA", str(ROOT.parent / "shared" / "realdata"))
sphinx_gallery_conf = {
    "examples_dirs": [str(ROOT / "examples")],
    "gallery_dirs": [str(generated / "gallery")],
    "filename_pattern": r"plot_",
    "ignore_pattern": r"__init__|cpp",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1000,
    "backreferences_dir": None,
    "remove_config_comments": True,
}

dqslam_paper_trials = 50  # seeds of the table and figure that the build makes

copybutton_prompt_text = "$ "
copybutton_exclude = ".linenos, .gp"
