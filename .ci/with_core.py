"""Run a module with another build of the package: with_core.py FOLDER MODULE [ARGUMENT...]."""

import runpy
import sys

folder, module, *arguments = sys.argv[1:]
# An editable installation finds the package before any path does.
sys.meta_path = [one for one in sys.meta_path if "Redirecting" not in type(one).__name__]
sys.path.insert(0, folder)
import dqslam._core  # noqa: E402

if not dqslam._core.__file__.startswith(folder):
    sys.exit(f"with_core: {dqslam._core.__file__} is not in {folder}")
sys.argv = [module, *arguments]
runpy.run_module(module, run_name="__main__", alter_sys=True)
